# SPDX-License-Identifier: Apache-2.0
"""Lens distortion in Python against OpenCV's, and its fold against the closed form."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

import simsense
from activestereo.camera.plan import plan_of, registered
from activestereo.common.lens import distort, is_distorting, is_drawn, undistort
from activestereo.compare.measured_image import warp_between
from activestereo.effects.core.laws import example_view

FISHEYE = (0.08, -0.03, 0.01, -0.002)
LENSES = {
    "polynomial": (-0.1, 0.03, 1e-3, -2e-3, 0.01),
    "rational": (0.1, -0.05, 1e-3, -2e-3, 0.01, 0.2, -0.03, 0.01),
    "pincushion": (0.8, 0.5, 1e-3, -2e-3, 0.3),
    "fisheye": FISHEYE,
    "equidistant": (0.0, 0.0, 0.0, 0.0),
}
BARREL = (-0.3, 0.0, 0.0, 0.0, 0.0)  # folds at a radius of 1 / sqrt(0.9), which it draws at 2/3 of that


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_a_lens_draws_where_opencv_draws_and_its_inverse_comes_back(lens):
    reach, is_fisheye = (4.0, True) if len(lens) == 4 else (1.2, False)
    x, y = (reach * a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 17), np.linspace(-0.75, 0.75, 13)))
    drawn = distort(x, y, lens)
    points, none = np.stack([x, y, np.ones_like(x)], axis=1)[:, None], np.zeros(3)
    if is_fisheye:
        expected = cv2.fisheye.distortPoints(points[..., :2], np.eye(3), np.array(lens))
        assert is_drawn(x, y, lens).all() and is_distorting(lens)
    else:
        expected = cv2.projectPoints(points, none, none, np.eye(3), np.array(lens))[0]
    np.testing.assert_allclose(np.stack(drawn, axis=1), expected[:, 0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(undistort(*drawn, lens), (x, y), rtol=0, atol=1e-9)


def test_a_fisheye_lens_folds_where_its_radius_stops_growing():
    """r = a - 0.25 a^3, whose slope is 0 at an angle of sqrt(4/3), and whose radius there is 2/3 of that."""
    lens, fold = (-0.25, 0.0, 0.0, 0.0), np.sqrt(4 / 3)
    x = np.tan(np.linspace(0.0, 1.5, 1501))
    drawn, _ = distort(x, 0 * x, lens)
    assert np.all(np.diff(drawn) > 0)
    near = np.abs(np.arctan(x) - fold) < 1e-3
    np.testing.assert_array_equal(is_drawn(x, 0 * x, lens)[~near], (np.arctan(x) < fold)[~near])
    assert np.isfinite(undistort(np.array([2.0]), np.array([0.0]), lens)).all()


def test_a_lens_folds_where_its_radius_stops_growing_and_positions_go_on_outwards():
    x = np.linspace(0.0, 3.0, 3001)
    drawn, _ = distort(x, 0 * x, BARREL)
    assert np.all(np.diff(drawn) > 0)
    fold = 1 / np.sqrt(0.9)
    np.testing.assert_array_equal(is_drawn(x, 0 * x, BARREL), x < fold)
    within = x < fold - 2e-3
    np.testing.assert_allclose(drawn[within], x[within] * (1 - 0.3 * x[within] ** 2), rtol=1e-14)
    np.testing.assert_allclose(undistort(drawn, 0 * x, BARREL)[0][within], x[within], atol=1e-6)
    # The radius of 1 / (1 - 0.5 r^2) grows up to the pole.
    x, lens = np.array([0.0, 1.4, 1.5, 2.5]), (0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0)
    np.testing.assert_array_equal(is_drawn(x, 0 * x, lens), [True, True, False, False])
    assert np.all(np.isfinite(distort(x, 0 * x, lens)))


def test_positions_of_two_shapes_are_refused():
    with pytest.raises(ValueError, match="x and y differ in their shape"):
        simsense.distort(np.zeros(3), np.zeros(2), BARREL)


def test_points_beyond_the_fold_are_not_registered(small_config):
    """The infrared camera sees directions up to 1.5; the RGB camera's lens would draw those beyond 1.054 again."""
    small_config.rgb_resolution = (140, 40)
    small_config.rgb_intrinsic = np.array([[100.0, 0, 69.5], [0, 100.0, 19.5], [0, 0, 1]])
    small_config.rgb_distortion = BARREL
    small_config.trans_pose_l = type(small_config.trans_pose_l)()
    k = np.array([[100.0, 0, 149.5], [0, 100.0, 19.5], [0, 0, 1]])
    beyond = np.zeros((40, 300), np.float32)
    beyond[:, np.abs(np.arange(300) - 149.5) > 110] = 1.0
    assert not registered(beyond, k, np.eye(4), plan_of(small_config)).any()
    assert registered(1.0 - beyond, k, np.eye(4), plan_of(small_config)).any()


def test_the_other_camera_does_not_see_beyond_its_fold():
    view = example_view()
    height, width = view.shape
    wide = np.array([[width / 3.0, 0, (width - 1) / 2], [0, width / 3.0, (height - 1) / 2], [0, 0, 1]])
    left = replace(view, K=wide, distortion=(0.0,) * 5, depth_m=np.ones(view.shape), left_to_camera=np.eye(4))
    right = replace(left, distortion=BARREL)
    x, y = left.rays()
    seen = warp_between(left, right).seen
    assert seen.any() and not np.any(seen & (np.hypot(x, y) > 1 / np.sqrt(0.9) + 1e-3))
