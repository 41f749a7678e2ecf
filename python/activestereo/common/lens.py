# SPDX-License-Identifier: Apache-2.0
"""Brown-Conrady lens distortion [k1, k2, p1, p2, k3], or rational with [k4, k5, k6] behind (OpenCV's order), of image
positions x, y in focal lengths."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_ITERATIONS = 20
_CONVERGED = 1e-10

Positions = tuple[NDArray[np.float64], NDArray[np.float64]]


def distort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Sequence[float] | np.ndarray) -> Positions:
    """Where a lens draws what an ideal pinhole draws at (x, y)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0)[:8]
    r2 = x * x + y * y
    radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    # A lens that turns over far outside the picture must not fold the scene back into it.
    radial = radial.clip(0.5, 2.0)
    return x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y


def pixel_rays(
    u: NDArray[np.int_], v: NDArray[np.int_], k: NDArray[np.float64], coefficients: Sequence[float] | np.ndarray
) -> NDArray[np.float64]:
    """[3, n]: where the middles of pixels (u, v) look, with z = 1."""
    rays = np.linalg.inv(k) @ np.stack([u, v, np.ones_like(u)]).astype(np.float64)
    if np.any(coefficients):
        rays[:2] = undistort(rays[0], rays[1], coefficients)
    return rays


def undistort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Sequence[float] | np.ndarray) -> Positions:
    """The inverse of distort(), by fixed-point iteration."""
    ideal_x, ideal_y = x, y
    for _ in range(_ITERATIONS):
        drawn_x, drawn_y = distort(ideal_x, ideal_y, coefficients)
        step_x, step_y = x - drawn_x, y - drawn_y
        ideal_x, ideal_y = ideal_x + step_x, ideal_y + step_y
        if max(np.abs(step_x).max(), np.abs(step_y).max()) < _CONVERGED:
            break
    return ideal_x, ideal_y
