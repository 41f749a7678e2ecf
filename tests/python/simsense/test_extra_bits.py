# SPDX-License-Identifier: Apache-2.0
"""extra_bits: the matcher sees bits of the converter that the images lack, as a RealSense's does."""

import numpy as np
import pytest

import simsense

WIDTH, HEIGHT, SHIFT = 160, 96, 8
LIGHT = np.random.default_rng(3).gamma(2.0, 40.0, (HEIGHT, WIDTH)).astype(np.float32)
PAIR = [np.roll(LIGHT, -shift, axis=1) for shift in (0, SHIFT)]
MATCHER = {"max_disparity": 32, "p2_full_gradient_dn": 3, "min_texture_dn": 2, "min_detection_sigma": 2.5}
SIGNAL = {
    "shot_noise": 1.0,
    "conversion_gain_dn_per_e": 0.5,
    "responsivity_e": 2.0,
    "adc_noise_dn": 0.1,
    "black_level_dn": 4.0,
}


def _engine(back_end="cpu", turned=0.02, **settings):
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -0.05
    left_to_right[:2, :2] = [[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]]
    camera = simsense.Camera(WIDTH, HEIGHT, [[200.0, 0, WIDTH / 2], [0, 200.0, HEIGHT / 2], [0, 0, 1]])
    device = simsense.Device("cpu" if back_end == "vulkan" else "host")
    return simsense.Engine(device, camera, camera, left_to_right, rectified=not turned, **settings)


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
    dark = [np.rint(random.normal(80.0, 2.0, (HEIGHT, WIDTH))).astype(np.uint16) for _ in range(2)]
    settings = MATCHER | {"bit_depth": 10, "noise_dn2": 4.0, "uniqueness_ratio": 0, "min_texture_dn": 0}

    def fill(**changes):
        return (_engine(turned=0.0, **(settings | changes)).compute(*dark, ("disparity",))["disparity"] >= 0).mean()

    assert fill() < 0.1 * fill(min_detection_sigma=0.0)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="extra_bits is 2 with a bit_depth of 10: must be 0, or bit_depth 8"):
        _engine(extra_bits=2, bit_depth=10)
    with pytest.raises(ValueError, match="extra_bits is 2 in the left signal and 0 in the right one: must be the same"):
        _engine().set_signal({"extra_bits": 2}, {})
