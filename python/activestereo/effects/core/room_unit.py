# SPDX-License-Identifier: Apache-2.0
"""A pattern projector that stands in the world, and where a fit of its pose may start.

The search first keeps the places from which an even beam would explain most of the residual. At each of them, and for
a few rolls, the residual is gathered on the unit's image plane; its correlation with the pattern gives pan and tilt at
once. The best few are then polished with the sharper pattern.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import gaussian_filter, zoom
from scipy.optimize import minimize

from activestereo.effects.core.judging import StartImage
from activestereo.effects.core.shading import Shading

_IMAGES, _COARSE_PIXELS, _FINE_PIXELS, _SEED = 4, 6000, 20000, 12
# Places around the seen points: so far beyond them, so far apart, and how many are looked at with the pattern.
_BEYOND_M, _STEP_M, _PLACES = 0.5, 0.1, 250
_ROLLS_RAD = (-0.08, 0.0, 0.08)
# Of the pattern: (Gaussian in its pixels, size) of the search and of the polish.
_COARSE, _FINE = (4.0, 0.25), (2.0, 0.5)
_POLISHED, _STARTS = 3, 2
# What is finer than so many pixels is dots or noise; where its mean square is less than so much noise, nothing is
# searched: no unit shows.
_FINE_PX, _LEAST_CHI2 = 4.0, 1.1
# A fall of chi2 that no correlation with noise gives, whichever of some 10^8 poses is the best (2 ln 10^8 = 37).
_LEAST_GAIN = 100.0


def axes(azimuth_rad: float, elevation_rad: float, roll_rad: float) -> np.ndarray:
    """Rotation [3][3] from a unit's axes (right, down, along its beam) to the world's. azimuth: of the beam about the
    world's y axis from z towards x; elevation: above the xz plane; roll: about the beam, right-handed.
    """
    level = np.cos(elevation_rad)
    along = np.array([level * np.sin(azimuth_rad), np.sin(elevation_rad), level * np.cos(azimuth_rad)])
    right = np.array([-np.cos(azimuth_rad), 0.0, np.sin(azimuth_rad)])
    down = np.cross(along, right)
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    return np.stack([c * right + s * down, c * down - s * right, along], axis=1)


def angles(along: np.ndarray) -> tuple[float, float]:
    """(azimuth, elevation) of a direction."""
    x, y, z = along / np.linalg.norm(along)
    return float(np.arctan2(x, z)), float(np.arcsin(np.clip(y, -1.0, 1.0)))


def room_unit_starts(images: list[StartImage]) -> list[dict[str, float]]:
    """Intensity and pose of the best few places; images without the own projector's dots count first. The neutral
    values alone where the residual has no dots.
    """
    chosen = sorted(images, key=lambda image: image.view.frame.projector_power)[:_IMAGES]
    if not chosen or np.mean([_fine_chi2(image) for image in chosen]) < _LEAST_CHI2:
        return [{}]
    seen = _Seen.of(chosen)
    coarse, fine = _Matcher(chosen[0], *_COARSE), _Matcher(chosen[0], *_FINE)
    few = seen.some(_COARSE_PIXELS)
    target = np.average(few.points, axis=0, weights=np.maximum(few.residual, 0.0) + 1e-12)
    found = []
    for place in _likely_places(few):
        azimuth, elevation = angles(target - place)
        for roll in _ROLLS_RAD:
            gain, strength, turned = coarse.best(few, np.array([*place, azimuth, elevation, roll]))
            found.append((gain, strength, turned))
    found.sort(key=lambda one: -one[0])
    starts = []
    for _, _, pose in found[:_POLISHED]:
        for matcher, size in ((coarse, 0.05), (fine, 0.015)):
            pose = matcher.polished(seen, pose, size)
        starts.append(fine.best(seen, pose))
    starts = sorted((start for start in starts if start[0] > _LEAST_GAIN), key=lambda one: -one[0])
    if not starts:
        return [{}]
    names = "x_m", "y_m", "z_m", "azimuth_rad", "elevation_rad", "roll_rad"
    return [
        {"intensity_m2": strength} | dict(zip(names, map(float, pose), strict=True))
        for _, strength, pose in starts[:_STARTS]
    ]


def _fine_chi2(image: StartImage) -> float:
    """Mean square of the residual's fine part over what noise alone leaves of it."""
    fine = image.residual - gaussian_filter(image.residual, _FINE_PX)
    return float(np.mean(image.weight * fine**2))


@dataclass(frozen=True)
class _Seen:
    """Pixels of several images. points, normals: world [n][3]. glow: DN of irradiance 1. weight: 1/DN^2."""

    points: np.ndarray
    normals: np.ndarray
    glow: np.ndarray
    weight: np.ndarray
    residual: np.ndarray

    @classmethod
    def of(cls, images: list[StartImage]) -> _Seen:
        columns = []
        for image in images:
            view, shading = image.view, Shading.of(image.light, image.view)
            to_world = view.frame.camera_to_world @ np.linalg.inv(view.left_to_camera)
            at = shading.hit & (shading.reflectance > 0)
            columns.append(
                (
                    shading.points[at] @ to_world[:3, :3].T + to_world[:3, 3],
                    shading.normal[at] @ to_world[:3, :3].T,
                    image.ambient_dn * shading.reflectance[at],
                    image.weight[at],
                    image.residual[at],
                )
            )
        return cls(*(np.concatenate(column) for column in zip(*columns, strict=True))).some(_FINE_PIXELS)

    def some(self, count: int) -> _Seen:
        pick = np.random.Generator(np.random.PCG64(_SEED)).permutation(len(self.residual))[:count]
        return _Seen(*(x[pick] for x in (self.points, self.normals, self.glow, self.weight, self.residual)))

    def lit_from(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(ways from a place to the points, DN of a source of intensity 1 there)."""
        way = self.points - place
        square = np.maximum((way**2).sum(-1), 1e-6)
        return way, self.glow * np.maximum(-(way * self.normals).sum(-1), 0.0) / (square * np.sqrt(square))


def _likely_places(seen: _Seen) -> list[np.ndarray]:
    low, high = np.quantile(seen.points, 0.02, axis=0) - _BEYOND_M, np.quantile(seen.points, 0.98, axis=0) + _BEYOND_M
    few, scored = seen.some(600), []
    for place in product(*(np.arange(a, b, _STEP_M) for a, b in zip(low, high, strict=True))):
        _, lit = few.lit_from(np.array(place))
        moment = max(lit @ (few.weight * few.residual), 0.0)
        scored.append((moment**2 / max(lit**2 @ few.weight, 1e-300), place))
    scored.sort(key=lambda one: -one[0])
    return [np.array(place) for _, place in scored[:_PLACES]]


class _Matcher:
    """The pattern at one sharpness, on a plane twice its size."""

    def __init__(self, image: StartImage, sigma_px: float, size: float) -> None:
        pattern = zoom(gaussian_filter(np.asarray(image.view.pattern, dtype=np.float64), sigma_px), size, order=1)
        self._shape = 2 * pattern.shape[0], 2 * pattern.shape[1]
        plane = np.zeros(self._shape)
        plane[: pattern.shape[0], : pattern.shape[1]] = pattern - pattern.mean()
        self._K = image.view.projector_K.copy()
        self._K[:2] *= size
        self._of_pattern, self._of_square = (np.conj(np.fft.rfft2(x)) for x in (plane, plane**2))
        self._mean = float(pattern.mean())

    def best(self, seen: _Seen, pose: np.ndarray) -> tuple[float, float, np.ndarray]:
        """(gain, intensity, pose) at the best pan and tilt near a pose (x, y, z, azimuth, elevation, roll)."""
        way, lit = seen.lit_from(pose[:3])
        turn = axes(*pose[3:])
        beam = way @ turn
        z = np.where(beam[:, 2] > 0.05, beam[:, 2], np.inf)
        height, width = self._shape
        column = np.rint(self._K[0, 0] * beam[:, 0] / z + self._K[0, 2] + width / 4).astype(int)
        row = np.rint(self._K[1, 1] * beam[:, 1] / z + self._K[1, 2] + height / 4).astype(int)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height) & (lit > 0) & np.isfinite(z)
        at = (row * width + column)[inside]
        lit, weight, residual = lit[inside], seen.weight[inside], seen.residual[inside]
        even = max(float(lit @ (weight * residual)), 0.0) / max(float(lit**2 @ weight), 1e-300)
        product_ = np.bincount(at, lit * weight * (residual - even * lit), height * width).reshape(self._shape)
        square = np.bincount(at, lit**2 * weight, height * width).reshape(self._shape)
        moment = np.fft.irfft2(np.fft.rfft2(product_) * self._of_pattern, self._shape)
        norm = np.fft.irfft2(np.fft.rfft2(square) * self._of_square, self._shape)
        strength = np.maximum(moment, 0.0) / np.maximum(norm, 1e-2 * norm.max() + 1e-300)
        gain = strength * np.maximum(moment, 0.0)
        i, j = np.unravel_index(int(np.argmax(gain)), self._shape)
        down, right = (k if k < 0.75 * n else k - n for k, n in ((i, height), (j, width)))
        ahead = np.array([(right - width / 4) / self._K[0, 0], (down - height / 4) / self._K[1, 1], 1.0])
        turned = np.array([*pose[:3], *angles(turn @ ahead), pose[5]])
        return float(gain[i, j]), float(strength[i, j]), turned

    def polished(self, seen: _Seen, pose: np.ndarray, size: float) -> np.ndarray:
        """The pose from which place and roll gain most, pan and tilt being the best."""
        towards = pose[3:5]

        def loss(x: np.ndarray) -> float:
            return -self.best(seen, np.array([*x[:3], *towards, x[3]]))[0]

        x0 = np.array([*pose[:3], pose[5]])
        simplex = np.stack([x0, *(x0 + size * np.eye(4))])
        found = minimize(loss, x0, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 90}).x
        return self.best(seen, np.array([*found[:3], *towards, found[3]]))[2]
