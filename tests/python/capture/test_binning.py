# SPDX-License-Identifier: Apache-2.0
"""Captures whose images are averaged over blocks of pixels show the same scene from the same places."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from activestereo.capture.capture import binned, unbinned, usual_binning, usual_samples
from activestereo.capture.capture import Camera, CaptureError, read_capture
from activestereo.capture.images import block_means, write_gray
from activestereo.effects import Light, Model, builtin
from activestereo.effects.core.laws import example_view
from virtual_sensor.world import make_world

SIZE = 3


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("world")
    capture = read_capture(make_world(folder, size=(98, 60), grid=1, bounces=0).capture_path)
    known = np.full((60, 98), 255, np.uint8)
    known[10, 20] = 0
    write_gray(folder / "known.png", known)
    frames = (replace(capture.frames[0], left_mask_path=folder / "known.png"), *capture.frames[1:])
    return replace(capture, frames=frames)


def test_a_block_sees_what_its_pixels_see(whole):
    small = binned(whole, SIZE)
    frame = small.frames[0]
    image, blocks = whole.ir(frame, "left"), small.ir(frame, "left")
    assert blocks.shape == (small.rig.left.height, small.rig.left.width) == (20, 32)
    assert blocks[7, 5] == pytest.approx(image[21:24, 15:18].mean())
    middle = np.linalg.inv(whole.rig.left.K) @ (16.0, 22.0, 1.0)
    np.testing.assert_allclose(np.linalg.inv(small.rig.left.K) @ (5.0, 7.0, 1.0), middle, atol=1e-12)
    assert np.argwhere(~small.known(frame, "left")).tolist() == [[3, 6]]


def test_what_is_found_on_blocks_is_told_of_the_whole(whole):
    small = binned(whole, SIZE)
    np.testing.assert_array_equal(unbinned(small).rig.left.K, whole.rig.left.K)
    longer = small.rig.left.K.copy()
    longer[:2, :2] *= 1.01
    moved = small.frames[0].camera_to_world + np.eye(4)[3] * 0.01
    found = unbinned(replace(
        small, rig=replace(small.rig, left=replace(small.rig.left, K=longer)),
        frames=(replace(small.frames[0], camera_to_world=moved), *small.frames[1:]),
    ))  # fmt: skip
    assert found.rig.left.K[0, 0] == pytest.approx(1.01 * whole.rig.left.K[0, 0])
    assert found.rig.left.K[0, 2] == whole.rig.left.K[0, 2]
    np.testing.assert_array_equal(found.frames[0].camera_to_world, moved)
    assert found.frames[0].depth_path == whole.frames[0].depth_path


def test_lengths_in_pixels_are_those_of_whole_images():
    image = gaussian_filter(np.random.default_rng(1).normal(100.0, 20.0, (120, 120)), 2.0)
    psf = Model().with_effect(builtin()["lens_psf"], sigma_px=3.0)

    def blur(pixels, size):
        view = replace(example_view(), binning=size, depth_m=np.ones(pixels.shape))
        return psf.light(Light.of_images([pixels] * 4), view).ambient

    fine, coarse = block_means(blur(image, 1), 2), blur(block_means(image, 2), 2)
    assert np.std(coarse - fine) < 0.1 * np.std(block_means(image, 2) - fine)


def test_large_images_are_averaged_and_small_ones_are_not(whole):
    sized = [
        replace(whole, rig=replace(whole.rig, left=Camera(width, height, np.eye(3))))
        for width, height in ((424, 240), (848, 480), (1280, 720))
    ]
    assert [usual_binning(capture) for capture in sized] == [1, 1, 3]
    assert [usual_samples(capture) for capture in sized] == [64, 64, 28]  # as many for a whole image
    with pytest.raises(CaptureError, match="cannot be averaged over 9: give 1 to 3"):
        binned(whole, 9)
