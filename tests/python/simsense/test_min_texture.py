# SPDX-License-Identifier: Apache-2.0
"""min_texture_dn from Python, as the presets have it: what a camera's own noise shows is refused, and a pattern of real
strength keeps its pixels."""

import numpy as np
import pytest

import simsense
from activestereo import StereoDepthSensorConfig

_WIDTH, _HEIGHT, _SHIFT, _BORDER = 320, 160, 8, 40


def _fill(model, light_dn, **changes):
    """Share of measured pixels of a pair through the preset's imager and matcher; light_dn: above the black level."""
    config = StereoDepthSensorConfig(model)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    camera = simsense.Camera(_WIDTH, _HEIGHT, [[200.0, 0, _WIDTH / 2], [0, 200.0, _HEIGHT / 2], [0, 0, 1]])
    settings = {
        name: getattr(config, name) for name in ("block_width", "block_height", "median_size", "min_texture_dn")
    }
    engine = simsense.Engine(
        simsense.Device("host"), camera, camera, left_to_right, rectified=True, max_disparity=32, **settings | changes
    )
    engine.set_signal(config.ir_signal, config.ir_signal)
    pair = [np.roll(light_dn, -shift, axis=1).astype(np.float32) for shift in (0, _SHIFT)]
    disparity = engine.compute(*pair, outputs=("disparity",))["disparity"].reshape(_HEIGHT, _WIDTH)
    return float((disparity[_BORDER:-_BORDER, _BORDER:-_BORDER] >= 0).mean())


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


@pytest.mark.parametrize("model", ["D415", "D435"])
def test_a_covered_lens_gives_no_depth(model):
    assert _fill(model, np.zeros((_HEIGHT, _WIDTH))) < 0.02


def test_a_black_surface_gives_no_depth():
    velvet = _dots(12.0, 40.0) * 0.004 / 0.5  # 12 DN on albedo 0.5 at 0.6 m
    assert _fill("D435", velvet, min_texture_dn=0) > 0.2
    assert _fill("D435", velvet) < 0.02


@pytest.mark.parametrize("room_dn", [45.0, 0.0])
@pytest.mark.parametrize("model", ["D415", "D435"])
def test_dots_of_a_recordings_strength_keep_their_pixels(model, room_dn):
    light_dn = _dots(1.9, room_dn)  # of the D415 at 2 m
    without = _fill(model, light_dn, min_texture_dn=0)
    assert without > 0.5
    assert _fill(model, light_dn) > without - 0.005
