# SPDX-License-Identifier: Apache-2.0
"""Lens distortion of image positions x, y in focal lengths, by the number of its coefficients: five are Brown and
Conrady's [k1, k2, p1, p2, k3], eight a rational lens' with [k4, k5, k6] behind (OpenCV's order), and four a fisheye
lens' [k1, k2, k3, k4] (Kannala and Brandt 2006, as in OpenCV's fisheye module). A lens images directions only up to the
radius at which its radial distortion folds. Both engines use the same text (capi/include/ks/lens.hpp)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import simsense

LENGTHS = (4, 5, 8)
_FISHEYE = 4

Positions = tuple[NDArray[np.float64], NDArray[np.float64]]
Coefficients = Sequence[float] | np.ndarray


def is_distorting(coefficients: Coefficients) -> bool:
    """Whether a lens differs from an ideal pinhole; a fisheye lens always does."""
    return len(coefficients) == _FISHEYE or bool(np.any(coefficients))


def lens_fields(coefficients: Coefficients) -> dict[str, Any]:
    """The lens as keyword arguments of kuafu.Camera and simsense.Camera."""
    model = "kannala_brandt" if len(coefficients) == _FISHEYE else "brown_conrady"
    return {"distortion": tuple(map(float, coefficients)), "lens_model": model}


def distort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> Positions:
    """Distorts an ideal pinhole's image positions (x, y). Beyond the fold, at which is_drawn() turns false, the radial
    factor stays constant, so positions keep moving outwards."""
    x, y = np.broadcast_arrays(x, y)
    return simsense.distort(x, y, **lens_fields(coefficients))


def undistort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> Positions:
    """The inverse of distort(), by Newton's method."""
    x, y = np.broadcast_arrays(x, y)
    return simsense.undistort(x, y, **lens_fields(coefficients))


def is_drawn(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.bool_]:
    """Whether a lens images the directions (x, y, 1): they lie within its fold, as in both engines."""
    return x * x + y * y < simsense.fold_radius2(**lens_fields(coefficients))


def pixel_rays(
    u: NDArray[np.int_], v: NDArray[np.int_], k: NDArray[np.float64], coefficients: Coefficients
) -> NDArray[np.float64]:
    """Ray directions [3, n] through the pixels' centres (u, v), with z = 1."""
    rays = np.linalg.inv(k) @ np.stack([u, v, np.ones_like(u)]).astype(np.float64)
    if is_distorting(coefficients):
        rays[:2] = undistort(rays[0], rays[1], coefficients)
    return rays
