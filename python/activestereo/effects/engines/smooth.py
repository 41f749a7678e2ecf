# SPDX-License-Identifier: Apache-2.0
"""Takes Monte Carlo noise out of bounced and ambient light: an edge-avoiding a-trous wavelet filter (Dammertz et al.
2010, HPG).

Such light is smooth along a diffuse surface, so a pixel may learn from neighbours of the same material that lie in its
tangent plane. The weights look at geometry alone, never at the noisy light, so the filter is linear in it; its mean
stays within a per cent (measured).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

# Changes whenever the filter does.
SMOOTH_VERSION = 6

# Cubic B-spline, 5 taps.
_TAPS = np.array([1, 4, 6, 4, 1]) / 16.0
# A level doubles the reach; so many make about this angle, whatever the resolution.
_REACH_RAD = 0.02
# Neighbours count less by their distance from the tangent plane, in shares of depth, and by their normals' angle:
# cosine^24.
_PLANE_SHARE = 0.006


class Surfaces(NamedTuple):
    """Surfaces that the samples of a view see, [height][width]; vectors [3][height][width] in one frame."""

    depth_m: np.ndarray
    normal: np.ndarray
    points: np.ndarray
    material: np.ndarray

    @classmethod
    def of(cls, depth_m: np.ndarray, normal: np.ndarray, points: np.ndarray, material: np.ndarray) -> Surfaces:
        """From vectors [height][width][3]."""
        normals, places = (
            np.ascontiguousarray(np.moveaxis(vectors, -1, 0), dtype=np.float32) for vectors in (normal, points)
        )
        return cls(np.asarray(depth_m, dtype=np.float32), normals, places, np.asarray(material))

    def at(self, place: Any) -> Surfaces:
        """Those at an index of rows and columns."""
        index = (..., *place)
        return Surfaces(self.depth_m[index], self.normal[index], self.points[index], self.material[index])


def smooth_bounced(image: np.ndarray, surfaces: Surfaces, focal_px: float) -> np.ndarray:
    """image [..., height, width], filtered where something is hit. focal_px: the camera's, in samples of the image."""
    levels = max(1, round(np.log2(focal_px * _REACH_RAD)))
    out = np.asarray(image, dtype=np.float32)
    for level in range(levels):
        out = _filter(out, surfaces, 1 << level)
    return np.where(surfaces.depth_m > 0, out, image)


def _filter(image: np.ndarray, surfaces: Surfaces, step: int) -> np.ndarray:
    shape = surfaces.depth_m.shape
    total, weight_sum = np.zeros_like(image), np.zeros(shape, np.float32)
    for j, row_tap in enumerate(_TAPS):
        for i, column_tap in enumerate(_TAPS):
            here, there = _overlap(shape, (j - 2) * step, (i - 2) * step)
            weight: Any = np.float32(row_tap * column_tap)
            if here != there:
                weight = weight * alike(surfaces.at(here), surfaces.at(there))
            total[(..., *here)] += weight * image[(..., *there)]
            weight_sum[here] += weight
    return total / weight_sum


def alike(here: Surfaces, there: Surfaces) -> np.ndarray:
    """1 for samples there of the surface here, towards 0 for those of another."""
    cosine = np.maximum(_dot(here.normal, there.normal), np.float32(1e-6))
    eighth = cosine * cosine
    eighth *= eighth
    eighth *= eighth
    off_plane = _dot(here.normal, there.points - here.points) / np.maximum(_PLANE_SHARE * here.depth_m, 1e-6)
    return (here.material == there.material) * (eighth * eighth * eighth) * np.exp(-off_plane * off_plane)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _overlap(shape: tuple[int, ...], down: int, right: int) -> tuple[Any, Any]:
    """Slices of the samples that have a neighbour at (down, right), and of those neighbours."""

    def axis(size: int, shift: int) -> tuple[slice, slice]:
        return slice(max(0, -shift), size - max(0, shift)), slice(max(0, shift), size - max(0, -shift))

    (row, row_there), (column, column_there) = axis(shape[0], down), axis(shape[1], right)
    return (row, column), (row_there, column_there)
