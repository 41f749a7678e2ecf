# SPDX-License-Identifier: Apache-2.0
"""min_detection_sigma, as the presets have it: what shows no more than noise is refused, and a pattern of real strength
keeps its pixels."""

import numpy as np
import pytest

import simsense
from activestereo import StereoDepthSensorConfig
from activestereo.camera.plan import matcher_parameters

_WIDTH, _HEIGHT, _SHIFT, _BORDER = 320, 160, 8, 40


def _fill(model, light_dn, part=np.s_[:], extra_bits=2, **changes):
    """Share of measured pixels of a pair through the preset's imager and matcher, but for the image's border; light_dn:
    above the black level. part: of the image."""
    config = StereoDepthSensorConfig(model)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    camera = simsense.Camera(_WIDTH, _HEIGHT, [[200.0, 0, _WIDTH / 2], [0, 200.0, _HEIGHT / 2], [0, 0, 1]])
    settings = matcher_parameters(config) | {"max_disparity": 32} | changes
    engine = simsense.Engine(simsense.Device("host"), camera, camera, left_to_right, rectified=True, **settings)
    no_laser = {"speckle_shape": 0.0, "speckle_scale": 0.0}  # room light has no speckle
    signal = config.ir_signal | no_laser | {"extra_bits": extra_bits}
    engine.set_signal(signal, signal)
    pair = [np.roll(light_dn, -shift, axis=1).astype(np.float32) for shift in (0, _SHIFT)]
    disparity = engine.compute(*pair, outputs=("disparity",))["disparity"].reshape(_HEIGHT, _WIDTH)
    inside = np.zeros(disparity.shape, bool)
    inside[_BORDER:-_BORDER, _BORDER:-_BORDER] = True
    return float((disparity[part][inside[part]] >= 0).mean())


def _dots(rms_dn, room_dn):
    """One dot of a random place in each cell of 9 pixels, a Gaussian of 0.9 px."""
    rng = np.random.default_rng(5)
    rows, columns = np.indices((_HEIGHT, _WIDTH))
    image = np.zeros((_HEIGHT, _WIDTH))
    for y in range(4, _HEIGHT, 9):
        for x in range(4, _WIDTH, 9):
            v, u = y + rng.uniform(-3, 3), x + rng.uniform(-3, 3)
            near = np.s_[max(0, int(v) - 6) : int(v) + 7, max(0, int(u) - 6) : int(u) + 7]
            image[near] += np.exp(-((rows[near] - v) ** 2 + (columns[near] - u) ** 2) / (2 * 0.9**2))
    return room_dn + image * rms_dn / image.std()


@pytest.mark.parametrize("light_dn", [0.0, 10.3, 45.0])
@pytest.mark.parametrize("model", ["D415", "D435"])
def test_an_empty_background_beside_a_thing_gets_no_depth(model, light_dn):
    left, right = 180, 230
    light = np.full((_HEIGHT, _WIDTH), light_dn)
    light[:, left:right] = _dots(6.0, light_dn)[:, left:right]
    background = np.s_[:, : left - 40]
    assert _fill(model, light, np.s_[:, left + _SHIFT : right]) > 0.9
    assert _fill(model, light, background) < 0.01


def test_without_the_check_the_background_gets_the_things_depth():
    light = np.zeros((_HEIGHT, _WIDTH))
    light[:, 180:230] = _dots(6.0, 0.0)[:, 180:230]
    assert _fill("D435", light, np.s_[:, :140], 0, min_detection_sigma=0) > 0.5


@pytest.mark.parametrize("room_dn", [45.0, 0.0])
@pytest.mark.parametrize("model", ["D415", "D435"])
def test_dots_of_a_recordings_strength_keep_their_pixels(model, room_dn):
    light_dn = _dots(1.9, room_dn)  # of the D415 at 2 m
    without = _fill(model, light_dn, min_detection_sigma=0)
    assert without > 0.5
    assert _fill(model, light_dn) > without - 0.005


@pytest.mark.parametrize("model", ["D415", "D435"])
def test_ten_bits_show_a_pattern_that_eight_hide(model):
    """A thing so dark that its dots hardly reach half a count."""
    light_dn = _dots(0.05, 0.1)
    assert _fill(model, light_dn) > 0.9
    assert _fill(model, light_dn, extra_bits=0) < 0.1
