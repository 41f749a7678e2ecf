# SPDX-License-Identifier: Apache-2.0
"""Brown-Conrady lens distortion [k1, k2, p1, p2, k3], or rational with [k4, k5, k6] behind (OpenCV's order), of image
positions x, y in focal lengths. A lens draws directions only up to the radius at which its radial distortion folds."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

_STEPS = 50
_CONVERGED = 1e-12
_LEAST_DETERMINANT = 1e-9  # of the Jacobian, where tangential distortion folds

Positions = tuple[NDArray[np.float64], NDArray[np.float64]]
Coefficients = Sequence[float] | np.ndarray


def distort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> Positions:
    """Where a lens draws what an ideal pinhole draws at (x, y). Beyond the fold, where is_drawn() is false, the radial
    factor stays as it is there, so that positions go on outwards."""
    k, _, last2 = _lens(tuple(map(float, coefficients)))
    radial, _ = _radial(np.minimum(x * x + y * y, last2), k)
    along_x, along_y = _tangential(x, y, k)
    return x * radial + along_x, y * radial + along_y


def is_drawn(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.bool_]:
    """Whether a lens draws the directions (x, y, 1): they lie within its fold, as both engines have it."""
    return x * x + y * y < _lens(tuple(map(float, coefficients)))[1]


def pixel_rays(
    u: NDArray[np.int_], v: NDArray[np.int_], k: NDArray[np.float64], coefficients: Coefficients
) -> NDArray[np.float64]:
    """[3, n]: where the middles of pixels (u, v) look, with z = 1."""
    rays = np.linalg.inv(k) @ np.stack([u, v, np.ones_like(u)]).astype(np.float64)
    if np.any(coefficients):
        rays[:2] = undistort(rays[0], rays[1], coefficients)
    return rays


def undistort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> Positions:
    """The inverse of distort(), by Newton's method."""
    k, _, last2 = _lens(tuple(map(float, coefficients)))
    ideal_x, ideal_y = x, y
    for _ in range(_STEPS):
        r2 = ideal_x * ideal_x + ideal_y * ideal_y
        radial, slope = _radial(np.minimum(r2, last2), k)
        slope = np.where(r2 < last2, slope, 0.0)
        along_x, along_y = _tangential(ideal_x, ideal_y, k)
        off_x, off_y = x - ideal_x * radial - along_x, y - ideal_y * radial - along_y
        if max(np.abs(off_x).max(initial=0.0), np.abs(off_y).max(initial=0.0)) < _CONVERGED:
            break
        p1, p2 = k[2:4]
        xx = radial + 2 * ideal_x * ideal_x * slope + 2 * p1 * ideal_y + 6 * p2 * ideal_x
        xy = 2 * ideal_x * ideal_y * slope + 2 * p1 * ideal_x + 2 * p2 * ideal_y
        yy = radial + 2 * ideal_y * ideal_y * slope + 6 * p1 * ideal_y + 2 * p2 * ideal_x
        determinant = np.maximum(xx * yy - xy * xy, _LEAST_DETERMINANT)
        ideal_x = ideal_x + (yy * off_x - xy * off_y) / determinant
        ideal_y = ideal_y + (xx * off_y - xy * off_x) / determinant
    return ideal_x, ideal_y


def _radial(r2: NDArray[np.float64], k: tuple[float, ...]) -> Positions:
    """The radial factor at the squared radius r2, and its derivative by r2."""
    k1, k2, _, _, k3, k4, k5, k6 = k
    under = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    factor = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / under
    return factor, (k1 + r2 * (2 * k2 + r2 * 3 * k3) - factor * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / under


def _tangential(x: NDArray[np.float64], y: NDArray[np.float64], k: tuple[float, ...]) -> Positions:
    p1, p2 = k[2:4]
    r2 = x * x + y * y
    return 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y


@lru_cache(maxsize=256)
def _lens(coefficients: tuple[float, ...]) -> tuple[tuple[float, ...], float, float]:
    """All 8 coefficients, and two squared radii: of the fold, the first, in steps of a thousandth of the focal length,
    beyond which a larger radius is not drawn farther out (100 where there is none; simsense/src/rig/undistort.cpp), and
    the last before it, where the factor is finite (infinite where there is none)."""
    k = (*coefficients, *(0.0,) * 8)[:8]
    r2 = (np.arange(10_000) * 1e-3) ** 2
    with np.errstate(all="ignore"):  # the denominator may be 0 beyond the fold
        radial, slope = _radial(r2, k)
        under = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
        folds = np.flatnonzero(~((under > 0) & (radial + 2 * r2 * slope > 0)))
    if not folds.size:
        return k, 100.0, float("inf")
    return k, float(r2[folds[0]]), float(r2[max(folds[0] - 1, 0)])
