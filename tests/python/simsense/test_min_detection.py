# SPDX-License-Identifier: Apache-2.0
"""The matcher refuses what shows no more than noise, keeps faint patterns, and counts bits that images lack."""

import numpy as np
import pytest
from activestereo import StereoDepthSensorConfig
from activestereo.camera.plan import matcher_parameters

import simsense
from depth_engines import depth_engine

_WIDTH, _HEIGHT, _SHIFT, _BORDER = 320, 160, 8, 40


def _fill(model, light_dn, part=np.s_[:], extra_bits=2, **changes):
    """Share of measured pixels inside of `part` through the preset's imager and matcher; light_dn: above the black."""
    config = StereoDepthSensorConfig(model)
    engine = depth_engine((_WIDTH, _HEIGHT), 200, **(matcher_parameters(config) | {"max_disparity": 32} | changes))
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


SMALL_WIDTH, SMALL_HEIGHT, SMALL_SHIFT = 160, 96, 8
LIGHT = np.random.default_rng(3).gamma(2.0, 40.0, (SMALL_HEIGHT, SMALL_WIDTH)).astype(np.float32)
PAIR = [np.roll(LIGHT, -shift, axis=1) for shift in (0, SMALL_SHIFT)]
MATCHER = {"max_disparity": 32, "p2_full_gradient_dn": 3, "min_texture_dn": 2, "min_detection_sigma": 2.5}
SIGNAL = {"shot_noise": 1.0, "conversion_gain_dn_per_e": 0.5, "responsivity_e": 2.0}
SIGNAL |= {"adc_noise_dn": 0.1, "black_level_dn": 4.0}


def _engine(back_end="cpu", turned=0.02, **settings):
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    left_to_right[:2, :2] = [[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]]
    camera = simsense.Camera(
        SMALL_WIDTH, SMALL_HEIGHT, [[200.0, 0, SMALL_WIDTH / 2], [0, 200.0, SMALL_HEIGHT / 2], [0, 0, 1]]
    )
    device = simsense.Device("cpu" if back_end == "vulkan" else "host")
    return simsense.Engine(device, camera, camera, left_to_right, rectified=not turned, back_end=back_end, **settings)


@pytest.mark.parametrize("back_end", ["cpu", "vulkan"])
def test_images_have_the_matchers_counts_rounded(back_end):
    engine = _engine(back_end, **MATCHER, **SIGNAL, extra_bits=2)
    names = ("ir_left", "ir_right", "rectified_left", "rectified_right")
    deep, images = engine.compute(*PAIR, dict.fromkeys(names, np.uint16)), engine.compute(*PAIR, names)
    for name in names:
        assert images[name].dtype == np.uint8 and deep[name].max() > 1000  # saturated counts, too
        assert np.unique(deep[name] % 4).size == 4
        np.testing.assert_array_equal(images[name], np.minimum(np.rint(deep[name] / 4), 255), err_msg=name)


@pytest.mark.parametrize("back_end", ["cpu", "vulkan"])
def test_the_matcher_finds_what_it_finds_in_counts_of_a_deeper_converter(back_end):
    extra = _engine(back_end, **MATCHER, **SIGNAL, extra_bits=2)
    scaled = {name: 4 * SIGNAL[name] for name in ("conversion_gain_dn_per_e", "adc_noise_dn", "black_level_dn")}
    matcher = MATCHER | {"p2_full_gradient_dn": 12, "min_texture_dn": 8}
    deeper = _engine(back_end, **matcher, **(SIGNAL | scaled), bit_depth=10)
    found, expected = (engine.compute(*PAIR, ("disparity", "confidence", "reason")) for engine in (extra, deeper))
    assert (expected["disparity"] >= 0).mean() > 0.5
    for name, image in expected.items():
        np.testing.assert_array_equal(found[name], image, err_msg=name)
    without = _engine(back_end, **MATCHER, **SIGNAL).compute(*PAIR, ("disparity",))["disparity"]
    assert not np.array_equal(without, found["disparity"])


def test_both_back_ends_give_the_same_bits():
    names = ("disparity", "confidence", "reason", "ir_left", "rectified_right")
    one, other = (_engine(b, **MATCHER, **SIGNAL, extra_bits=2).compute(*PAIR, names) for b in ("cpu", "vulkan"))
    for name in names:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def test_recorded_counts_of_ten_bits_are_checked_for_more_than_noise():
    random = np.random.default_rng(0)
    dark = [np.rint(random.normal(80.0, 2.0, (SMALL_HEIGHT, SMALL_WIDTH))).astype(np.uint16) for _ in range(2)]
    settings = MATCHER | {"bit_depth": 10, "noise_dn2": 4.0, "uniqueness_ratio": 0, "min_texture_dn": 0}

    def fill(**changes):
        return (_engine(turned=0.0, **(settings | changes)).compute(*dark, ("disparity",))["disparity"] >= 0).mean()

    assert fill() < 0.1 * fill(min_detection_sigma=0.0)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="extra_bits is 2 with a bit_depth of 10: must be 0, or bit_depth 8"):
        _engine(extra_bits=2, bit_depth=10)
    with pytest.raises(ValueError, match="extra_bits is 2 in the left signal and 0 in the right one: must be the same"):
        _engine().set_signal({"extra_bits": 2}, {})
