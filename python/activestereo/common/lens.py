# SPDX-License-Identifier: Apache-2.0
"""Lens distortion of image positions x, y in focal lengths, by the number of its coefficients: five are Brown and
Conrady's [k1, k2, p1, p2, k3], eight a rational lens' with [k4, k5, k6] behind (OpenCV's order), and four a fisheye
lens' [k1, k2, k3, k4] (Kannala and Brandt 2006, as in OpenCV's fisheye module). A lens images directions only up to the
radius at which its radial distortion folds."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

LENGTHS = (4, 5, 8)
_FISHEYE = 4

_STEPS = 50
_CONVERGED = 1e-12
_LEAST_DETERMINANT = 1e-9  # of the Jacobian, where tangential distortion folds

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
    k, _, last2 = _lens(tuple(map(float, coefficients)))
    r2 = np.minimum(x * x + y * y, last2)
    if len(coefficients) == _FISHEYE:
        scale = _fisheye_scale(np.sqrt(r2), k)
        return x * scale, y * scale
    radial, _ = _radial(r2, k)
    along_x, along_y = _tangential(x, y, k)
    return x * radial + along_x, y * radial + along_y


def is_drawn(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.bool_]:
    """Whether a lens images the directions (x, y, 1): they lie within its fold, as in both engines."""
    return x * x + y * y < _lens(tuple(map(float, coefficients)))[1]


def pixel_rays(
    u: NDArray[np.int_], v: NDArray[np.int_], k: NDArray[np.float64], coefficients: Coefficients
) -> NDArray[np.float64]:
    """Ray directions [3, n] through the pixels' centres (u, v), with z = 1."""
    rays = np.linalg.inv(k) @ np.stack([u, v, np.ones_like(u)]).astype(np.float64)
    if is_distorting(coefficients):
        rays[:2] = undistort(rays[0], rays[1], coefficients)
    return rays


def undistort(x: NDArray[np.float64], y: NDArray[np.float64], coefficients: Coefficients) -> Positions:
    """The inverse of distort(), by Newton's method."""
    k, _, last2 = _lens(tuple(map(float, coefficients)))
    if len(coefficients) == _FISHEYE:
        return _undistort_fisheye(x, y, k, float(np.arctan(np.sqrt(last2))))
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


def _fisheye_radius(angle: NDArray[np.float64], k: tuple[float, ...]) -> Positions:
    """Image radius of a fisheye lens at an angle from its axis, in focal lengths, and its derivative."""
    a2 = angle * angle
    radius = angle * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))))
    return radius, 1.0 + a2 * (3 * k[0] + a2 * (5 * k[1] + a2 * (7 * k[2] + a2 * 9 * k[3])))


def _fisheye_scale(r: NDArray[np.float64], k: tuple[float, ...]) -> NDArray[np.float64]:
    radius, _ = _fisheye_radius(np.arctan(r), k)
    return np.divide(radius, r, out=np.ones_like(r), where=r > _CONVERGED)


def _undistort_fisheye(
    x: NDArray[np.float64], y: NDArray[np.float64], k: tuple[float, ...], last: float
) -> Positions:
    """last: the largest angle that the lens images; larger ones are clamped to it."""
    radius = np.hypot(x, y)
    angle = np.minimum(radius, last)
    for _ in range(_STEPS):
        seen, slope = _fisheye_radius(angle, k)
        off = radius - seen
        if np.abs(off[angle < last]).max(initial=0.0) < _CONVERGED:
            break
        angle = np.clip(angle + off / np.maximum(slope, _LEAST_DETERMINANT), 0.0, last)
    scale = np.divide(np.tan(angle), radius, out=np.ones_like(radius), where=radius > _CONVERGED)
    return x * scale, y * scale


@lru_cache(maxsize=256)
def _lens(coefficients: tuple[float, ...]) -> tuple[tuple[float, ...], float, float]:
    """Pads the coefficients and finds two squared radii.

    The fold: the first radius, in steps of 1e-3 focal lengths (fisheye: 1e-4 rad), beyond which a larger radius is not
    imaged farther out (100 if there is none, 1e8 for a fisheye; simsense/src/rig/undistort.cpp). The last radius before
    it with a finite factor (infinite if there is none)."""
    if len(coefficients) == _FISHEYE:
        angle = np.arange(0.0, np.pi / 2, 1e-4)
        folds = np.flatnonzero(_fisheye_radius(angle, coefficients)[1] <= 0)
        if not folds.size:
            return coefficients, 1e8, 1e8
        return coefficients, float(np.tan(angle[folds[0]]) ** 2), float(np.tan(angle[max(folds[0] - 1, 0)]) ** 2)
    k = (*coefficients, *(0.0,) * 8)[:8]
    r2 = (np.arange(10_000) * 1e-3) ** 2
    with np.errstate(all="ignore"):  # the denominator may be 0 beyond the fold
        radial, slope = _radial(r2, k)
        under = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
        folds = np.flatnonzero(~((under > 0) & (radial + 2 * r2 * slope > 0)))
    if not folds.size:
        return k, 100.0, float("inf")
    return k, float(r2[folds[0]]), float(r2[max(folds[0] - 1, 0)])
