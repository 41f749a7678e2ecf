# SPDX-License-Identifier: Apache-2.0
"""The projector patterns' laws."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from activestereo import StereoDepthSensorConfig
from activestereo.camera.plan import pattern_of
from activestereo.common.pattern import UNIQUE_WINDOW, PatternDesign, dots, make_pattern


def camera_pixels(config):
    """Pattern pixels in one pixel of the infrared camera; the same at every distance, since both see angles."""
    image, k = pattern_of(config)
    return k[0, 0] / config.ir_intrinsic[0, 0]


def test_windows_along_a_row_are_unique_within_the_disparity_range():
    """A law of random dots; a D415's lattices repeat, as the device's do. Two windows of UNIQUE_WINDOW pixels (of a
    D435: a third as long as a dot's cell is high) at 1..max_disparity pixels from each other differ by at least half
    the energy of a mean dot. From one dot's width on: nearer than that a window overlaps itself."""
    config = StereoDepthSensorConfig("D435")
    design = config.pattern_design
    image = (make_pattern(design).astype(np.float32) / 255.0 - design.background) / (1.0 - design.background)
    mean_square_peak = (1.0 + design.weakest_dot + design.weakest_dot**2) / 3.0
    dot_energy = np.pi * design.dot_sigma_px**2 * mean_square_peak
    pixel = design.dot_pitch_px / 9.0  # of a D435, whose cells are 9 pixels high
    width, height = (int(side * pixel) | 1 for side in UNIQUE_WINDOW)
    least = np.inf
    for shift in range(int(np.ceil(4.0 * design.dot_sigma_px)), int(config.max_disparity * camera_pixels(config)) + 1):
        difference = (image[:, shift:] - image[:, :-shift]) ** 2
        sums = cv2.boxFilter(difference, -1, (width, height), normalize=False)
        inside = sums[height // 2 : -(height // 2), width // 2 : -(width // 2)]
        least = min(least, float(inside.min()) / dot_energy)
    assert least >= 0.5


def test_d435_shows_about_5000_dots_to_its_cameras():
    config = StereoDepthSensorConfig("D435")
    _, k = pattern_of(config)
    x, y, _ = dots(config.pattern_design)
    u = (x - k[0, 2]) / k[0, 0] * config.ir_intrinsic[0, 0] + config.ir_intrinsic[0, 2]
    v = (y - k[1, 2]) / k[1, 1] * config.ir_intrinsic[1, 1] + config.ir_intrinsic[1, 2]
    seen = (u >= 0) & (u < config.ir_resolution[0]) & (v >= 0) & (v < config.ir_resolution[1])
    assert 4500 < seen.sum() < 5500


@pytest.mark.parametrize("model", ["D415", "D435"])
def test_pattern_covers_the_infrared_view(model):
    config = StereoDepthSensorConfig(model)
    image, k = pattern_of(config)
    for axis, pixels in ((0, image.shape[1]), (1, image.shape[0])):
        half_camera = 0.5 * config.ir_resolution[axis] / config.ir_intrinsic[axis, axis]
        assert 0.5 * pixels / k[axis, axis] > half_camera
    assert 2.0 * np.arctan(0.5 * image.shape[1] / k[0, 0]) == pytest.approx(config.active_light_fov)


def test_every_cell_has_one_dot_and_dots_do_not_merge():
    design = PatternDesign(800, 400, 10.0, 1.0)
    x, y, peak = dots(design)
    cells = set(zip((x // 10).astype(int), (y // 10).astype(int), strict=True))
    assert len(cells) == len(x)
    assert len(x) >= 0.97 * 80 * 40  # a few centres fall outside the last row and column
    assert peak.min() >= design.weakest_dot and peak.max() <= 1.0
    assert np.ptp(peak) > 0.45


def test_lattices_have_their_pitch_in_the_middle_and_even_sines_everywhere():
    """A grating's orders lie at even steps of the sine (its equation), which is what turns back into a lattice here."""
    config = StereoDepthSensorConfig("D415")
    design = replace(config.pattern_design, lattice_angles_deg=(30.0,))
    x, y, peak = dots(design)
    ray = np.stack([x - 0.5 * (design.width - 1), y - 0.5 * (design.height - 1), np.full(len(x), design.focal_px)])
    sines = (ray / np.linalg.norm(ray, axis=0))[:2]
    turn = np.deg2rad(30.0)
    steps = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ sines
    steps *= design.focal_px / design.dot_pitch_px
    offset = steps - np.rint(steps - steps[:, :1]) - steps[:, :1]
    assert np.abs(offset).max() < 1e-9
    near = np.hypot(*(ray[:2] - ray[:2, [np.argmin(np.hypot(*ray[:2]))]]))
    assert np.sort(near)[1] == pytest.approx(design.dot_pitch_px, rel=0.01)
    assert len(dots(config.pattern_design)[0]) == pytest.approx(2 * len(x), rel=0.02)
    assert peak.min() >= design.weakest_dot


def test_a_pattern_is_its_seeds_and_dark_between_bright_dots():
    design = PatternDesign(800, 400, 10.0, 1.0, seed=3)
    image = make_pattern(design)
    np.testing.assert_array_equal(image, make_pattern(design))
    assert (image != make_pattern(replace(design, seed=4))).mean() > 0.2
    assert image.max() > 240 and np.median(image) < 0.1 * image.max()


def test_pattern_does_not_depend_on_library_versions():
    """SplitMix64 of seed 0's first counter values, from the published algorithm in exact integers."""
    from activestereo.common.pattern import _random

    def splitmix64(count):
        mask = 2**64 - 1
        z = count * 0x9E3779B97F4A7C15 & mask
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & mask
        z = (z ^ z >> 27) * 0x94D049BB133111EB & mask
        return ((z ^ z >> 31) >> 11) / 2**53

    np.testing.assert_array_equal(_random(0, 0, (3,)), [splitmix64(i) for i in (1, 2, 3)])
