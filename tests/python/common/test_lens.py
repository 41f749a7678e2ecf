# SPDX-License-Identifier: Apache-2.0
"""Lens distortion in Python against OpenCV's."""

import cv2
import numpy as np
import pytest

from activestereo.common.lens import distort, undistort

LENSES = [(-0.1, 0.03, 1e-3, -2e-3, 0.01), (0.1, -0.05, 1e-3, -2e-3, 0.01, 0.2, -0.03, 0.01)]


@pytest.mark.parametrize("lens", LENSES, ids=["polynomial", "rational"])
def test_a_lens_draws_where_opencv_draws_and_its_inverse_comes_back(lens):
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-0.8, 0.8, 17), np.linspace(-0.5, 0.5, 11)))
    drawn = distort(x, y, lens)
    points = np.stack([x, y, np.ones_like(x)], axis=1)
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(lens))[0].reshape(-1, 2)
    np.testing.assert_allclose(np.stack(drawn, axis=1), expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(undistort(*drawn, lens), (x, y), rtol=0, atol=1e-6)
