# SPDX-License-Identifier: Apache-2.0
"""How well a pattern projector at a pose explains what is seen: on the unit's own image plane.

Pan and tilt move the pattern over that plane, nearly, so that a correlation finds the best ones near a pose at once.
Farther away the plane is seen too obliquely: see sphere_match.
"""

from __future__ import annotations

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter, zoom
from scipy.optimize import minimize

from activestereo.effects.core.pointing import angles, axes
from activestereo.effects.core.seen_points import SeenPoints
from activestereo.effects.core.view import View


def blurred_pattern(view: View, sigma_rad: float, focal_px: float) -> tuple[np.ndarray, np.ndarray]:
    """(the projector's pattern, its intrinsics [3][3]) after a Gaussian, resized to a focal length."""
    size = focal_px / view.projector_K[0, 0]
    blurred = gaussian_filter(np.asarray(view.pattern, dtype=np.float64), sigma_rad * view.projector_K[0, 0])
    pattern = zoom(blurred, size, order=1)
    K = view.projector_K.copy()
    K[:2] *= size
    return pattern, K


def pixels_of(
    beam: np.ndarray, K: np.ndarray, shape: tuple[int, ...], margin_px: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(row, column, whether there is one) where directions [...][3] of a unit's frame meet an image plane of this shape
    [rows, columns]. margin_px: rows and columns of it before the pattern's first."""
    z = np.where(beam[..., 2] > 0.05, beam[..., 2], np.inf)
    column = np.rint(K[0, 0] * beam[..., 0] / z + K[0, 2] + margin_px[1]).astype(int)
    row = np.rint(K[1, 1] * beam[..., 1] / z + K[1, 2] + margin_px[0]).astype(int)
    inside = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0]) & np.isfinite(z)
    return row, column, inside


class PlaneMatch:
    """The pattern at one sharpness, on a plane about twice its size. Poses are (x, y, z, azimuth, elevation, roll)."""

    def __init__(self, view: View, sigma_rad: float, focal_px: float) -> None:
        pattern, self._K = blurred_pattern(view, sigma_rad, focal_px)
        self._shape = fft.next_fast_len(2 * pattern.shape[0], True), fft.next_fast_len(2 * pattern.shape[1], True)
        plane = np.zeros(self._shape, np.float32)
        plane[: pattern.shape[0], : pattern.shape[1]] = pattern - pattern.mean()
        self._of_pattern, self._of_square = (np.conj(fft.rfft2(x)) for x in (plane, plane**2))

    def best(self, seen: SeenPoints, pose: np.ndarray) -> tuple[float, float, np.ndarray]:
        """(fall of chi2, intensity, pose) at the best pan and tilt near a pose."""
        way, lit = seen.lit_from(pose[:3])
        turn = axes(*pose[3:])
        height, width = self._shape
        row, column, inside = pixels_of(way @ turn, self._K, self._shape, (height / 4, width / 4))
        inside &= lit > 0
        at, lit = (row * width + column)[inside], np.where(inside, lit, 0.0)
        left, lit, weight = seen.beyond_even(lit)[inside], lit[inside], seen.weight[inside]
        moment = self._correlated(at, lit * left, self._of_pattern)
        norm = self._correlated(at, lit**2 * weight, self._of_square)
        strength = np.maximum(moment, 0.0) / np.maximum(norm, 1e-2 * norm.max() + np.float32(1e-30))
        gain = strength * np.maximum(moment, 0.0)
        i, j = np.unravel_index(int(np.argmax(gain)), self._shape)
        down, right = (k if k < 0.75 * n else k - n for k, n in ((i, height), (j, width)))
        ahead = np.array([(right - width / 4) / self._K[0, 0], (down - height / 4) / self._K[1, 1], 1.0])
        turned = np.array([*pose[:3], *angles(turn @ ahead), pose[5]])
        return float(gain[i, j]), float(strength[i, j]), turned

    def _correlated(self, at: np.ndarray, values: np.ndarray, conjugate: np.ndarray) -> np.ndarray:
        plane = np.bincount(at, values, self._shape[0] * self._shape[1]).reshape(self._shape).astype(np.float32)
        return fft.irfft2(fft.rfft2(plane) * conjugate, self._shape)

    def polished(self, seen: SeenPoints, pose: np.ndarray, size: float) -> np.ndarray:
        """The pose from which place (a simplex of so many metres) and roll gain most, pan and tilt being the best."""
        towards = pose[3:5]

        def loss(x: np.ndarray) -> float:
            return -self.best(seen, np.array([*x[:3], *towards, x[3]]))[0]

        x0 = np.array([*pose[:3], pose[5]])
        simplex = np.stack([x0, *(x0 + size * np.eye(4))])
        found = minimize(loss, x0, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 90}).x
        return self.best(seen, np.array([*found[:3], *towards, found[3]]))[2]
