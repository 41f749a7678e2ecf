# SPDX-License-Identifier: Apache-2.0
"""Fisheye pairs: rectified as OpenCV does, and registered with the same bits on both back ends."""

import cv2
import numpy as np
import pytest

import simsense
from activestereo.common.pose import rigid_motion

WIDTH, HEIGHT = 192, 144
K = np.array([[90.0, 0, 95.0], [0, 91.0, 72.0], [0, 0, 1]])
LENS = np.array([0.06, -0.02, 0.008, -0.001])
TURN = cv2.Rodrigues(np.array([0.01, -0.015, 0.008]))[0]


@pytest.fixture(scope="module")
def pair():
    """Blurred noise, which interpolation keeps."""
    noise = np.random.default_rng(1).random((2, HEIGHT, WIDTH)) * 255
    return [np.clip(cv2.GaussianBlur(image, (0, 0), 2.0) * 3 - 255, 0, 255).astype(np.uint8) for image in noise]


def engine(back_end, registered=False):
    camera = simsense.Camera(WIDTH, HEIGHT, K, LENS, "kannala_brandt")
    pose = rigid_motion((-0.05, 0.001, 0.0005), TURN)
    more = {}
    if registered:
        k = np.array([[70.0, 0, 79.0], [0, 70.0, 59.0], [0, 0, 1]])
        more = {"rgb": simsense.Camera(160, 120, k, 2 * LENS, "kannala_brandt"), "left_to_rgb": pose}
    device = simsense.Device("cpu" if back_end == "vulkan" else "host")
    return simsense.Engine(device, camera, camera, pose, back_end=back_end, max_disparity=32, **more)


def test_a_fisheye_pair_is_rectified_as_opencv_does(pair):
    own = engine("cpu")
    images = own.compute(*pair, outputs=("rectified_left",))
    k, _, turn = own.rectified
    maps = cv2.fisheye.initUndistortRectifyMap(K, LENS, turn[:3, :3], k, (WIDTH, HEIGHT), cv2.CV_32FC1)
    expected = cv2.remap(pair[0], *maps, cv2.INTER_LINEAR)
    inside = (maps[0] > 1) & (maps[0] < WIDTH - 2) & (maps[1] > 1) & (maps[1] < HEIGHT - 2)
    off = np.abs(images["rectified_left"].reshape(HEIGHT, WIDTH).astype(int) - expected)[inside]
    assert inside.mean() > 0.6 and off.max() <= 2 and off.mean() < 0.3


def test_both_back_ends_give_the_same_bits(pair):
    outputs = ("rectified_left", "rectified_right", "disparity", "depth", "depth_rgb", "points")
    both = [engine(back_end, registered=True).compute(*pair, outputs=outputs) for back_end in ("cpu", "vulkan")]
    for name in outputs:
        np.testing.assert_array_equal(both[0][name], both[1][name], err_msg=name)
    assert (both[0]["depth_rgb"] > 0).sum() > 500


def test_what_is_no_lens_is_refused():
    with pytest.raises(ValueError, match="unknown lens_model 'fisheye'"):
        simsense.Camera(WIDTH, HEIGHT, K, LENS, "fisheye")
    with pytest.raises(ValueError, match="3 numbers"):
        simsense.Camera(WIDTH, HEIGHT, K, LENS[:3])
