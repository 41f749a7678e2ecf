# SPDX-License-Identifier: Apache-2.0
"""Patches of an image with planar true disparity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float32]
PATCH_PX = 96
_MOST_RMS_PX, _LEAST_KNOWN = 0.05, 0.95


@dataclass(frozen=True)
class Patch:
    """place: rows and columns. plane: disparity = plane @ (x, y, 1) of the image's pixels. depth_m: in the middle."""

    place: tuple[slice, slice]
    plane: NDArray[np.float64]
    depth_m: float

    def disparity(self) -> Map:
        v, u = np.mgrid[self.place]
        return (self.plane[0] * u + self.plane[1] * v + self.plane[2]).astype(np.float32)


def planar_patches(truth: Map, focal_baseline_px_m: float) -> list[Patch]:
    """truth: disparities, NaN = unknown. Patches side by side."""
    height, width = truth.shape
    found = []
    for y in range(0, height - PATCH_PX + 1, PATCH_PX):
        for x in range(0, width - PATCH_PX + 1, PATCH_PX):
            place = slice(y, y + PATCH_PX), slice(x, x + PATCH_PX)
            plane, rms = fitted_plane(truth[place], y, x)
            if rms < _MOST_RMS_PX:
                middle = float(plane @ [x + 0.5 * PATCH_PX, y + 0.5 * PATCH_PX, 1.0])
                found.append(Patch(place, plane, focal_baseline_px_m / middle))
    return found


def fitted_plane(
    disparity: Map, y: int = 0, x: int = 0, least_known: float = _LEAST_KNOWN
) -> tuple[NDArray[np.float64], float]:
    """(plane, RMS distance from it) without pixels more than 1 px off; inf if less than the least share is known."""
    rows, columns = np.nonzero(np.isfinite(disparity))
    values = disparity[rows, columns].astype(np.float64)
    if len(values) < least_known * disparity.size:
        return np.zeros(3), np.inf
    terms = np.stack([columns + x, rows + y, np.ones(len(rows))], axis=1).astype(np.float64)
    kept = np.ones(len(values), bool)
    plane = np.zeros(3)
    for _ in range(4):
        plane = np.linalg.lstsq(terms[kept], values[kept], rcond=None)[0]
        kept = np.abs(values - terms @ plane) < 1.0
        if kept.sum() < 0.5 * len(values):
            return plane, np.inf
    return plane, float(np.sqrt(np.mean((values - terms @ plane)[kept] ** 2)))
