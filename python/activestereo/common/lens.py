# SPDX-License-Identifier: Apache-2.0
"""Distorts and undistorts image positions x, y, in units of the focal length. The number of coefficients selects the
lens model:
5: Brown and Conrady, [k1, k2, p1, p2, k3]; 8: rational, with [k4, k5, k6] behind them (OpenCV's order);
4: fisheye, [k1, k2, k3, k4] (Kannala and Brandt 2006, as in OpenCV's fisheye module).
A lens images directions only up to its fold, the radius at which the radial distortion stops growing. Both engines use
the same code (capi/include/ks/lens.hpp)."""

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
    """Returns whether a lens differs from an ideal pinhole; a fisheye lens always does."""
    return len(coefficients) == _FISHEYE or bool(np.any(coefficients))


def lens_fields(coefficients: Coefficients) -> dict[str, Any]:
    """Returns the lens as keyword arguments of kuafu.Camera and simsense.Camera: coefficients and the model's name."""
    model = "kannala_brandt" if len(coefficients) == _FISHEYE else "brown_conrady"
    return {"distortion": tuple(map(float, coefficients)), "lens_model": model}


def distort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> Positions:
    """Maps positions (x, y) of an ideal pinhole's image to positions in the distorted image. Beyond the fold, where
    is_drawn() is false, the radial factor stays constant, so positions keep moving outwards."""
    x, y = np.broadcast_arrays(x, y)
    return simsense.distort(x, y, **lens_fields(coefficients))


def undistort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> Positions:
    """Inverts distort() by Newton's method: maps distorted positions (x, y) to those of an ideal pinhole."""
    x, y = np.broadcast_arrays(x, y)
    return simsense.undistort(x, y, **lens_fields(coefficients))


def is_drawn(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.bool_]:
    """Returns a mask of the directions (x, y, 1) that the lens images, which lie within its fold."""
    return x * x + y * y < simsense.fold_radius2(**lens_fields(coefficients))


def to_tangents(u: NDArray[Any], v: NDArray[Any], k: NDArray[Any], coefficients: Coefficients = ()) -> Positions:
    """Maps pixels (u, v) to the directions (x, y, 1) that they see. k: 3x3 camera matrix; no coefficients: a
    pinhole."""
    y = (v - k[1, 2]) / k[1, 1]
    x = (u - k[0, 2] - k[0, 1] * y) / k[0, 0]
    return undistort(x, y, coefficients) if is_distorting(coefficients) else (x, y)


def to_pixels(x: NDArray[Any], y: NDArray[Any], k: NDArray[Any], coefficients: Coefficients = ()) -> Positions:
    """Maps directions (x, y, 1) to pixels (u, v), the inverse of to_tangents()."""
    if is_distorting(coefficients):
        x, y = distort(x, y, coefficients)
    return k[0, 0] * x + k[0, 1] * y + k[0, 2], k[1, 1] * y + k[1, 2]


def with_finer_pixels(k: NDArray[np.float64], n: float) -> NDArray[np.float64]:
    """Returns the 3x3 camera matrix of the same view with n times as many pixels along each side."""
    k = k.copy()
    k[:2] *= n
    k[:2, 2] += 0.5 * (n - 1.0)  # pixel centres are whole numbers
    return k


def disparity_of(depth_m: NDArray[np.float32], focal_baseline_px_m: float) -> NDArray[np.float32]:
    """Converts depth in metres into disparity in pixels, NaN without depth."""
    with np.errstate(divide="ignore"):
        return np.where(depth_m > 0, focal_baseline_px_m / depth_m, np.nan).astype(np.float32)
