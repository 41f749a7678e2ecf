# SPDX-License-Identifier: Apache-2.0
"""Checks which image of an infrared pair is the left camera's, and whether the rows of both images match. It finds
patches of the first image in the second one, and needs no calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.common.parabola import vertex

_PATCH_PX, _ROWS_PX = 25, 6
_DISPARITY_SHARE = 0.25  # share of the image's width, as for a D435 at 0.2 m
_MOST_PATCHES, _LEAST_PATCHES = 240, 30
_LEAST_CORRELATION = 0.7
# A patch on an edge matches all along the edge. So columns more than _BESIDE_PX away must correlate less by _CLEARLY.
_CLEARLY, _BESIDE_PX = 0.03, 8
# A pair is swapped if more than this share of patches lies further right in the second image; noise alone gives half.
_SWAPPED = 0.8


@dataclass(frozen=True)
class CameraOrder:
    """The result of camera_order(). patches: number of patches of the left image that were found in the right image.
    nearer_right: share of these with a negative disparity, which no surface has; large if the images are exchanged.
    row_offset_px: median of (row in the right image - row in the left one). row_spread_px: half the width of the middle
    68 % of that difference."""

    patches: int
    nearer_right: float
    row_offset_px: float
    row_spread_px: float

    @property
    def is_told(self) -> bool:
        return self.patches >= _LEAST_PATCHES

    @property
    def is_swapped(self) -> bool:
        return self.is_told and self.nearer_right > _SWAPPED


def camera_order(
    pairs: Sequence[tuple[NDArray[np.generic], NDArray[np.generic]]], offset_px: float = 0.0
) -> CameraOrder:
    """Computes the CameraOrder of pairs (left, right), images [height][width] of one size. offset_px: cx of the right
    camera minus cx of the left one; infinitely far points are shifted by it."""
    shifts = []  # how far a patch lies further right and lower in the right image, pixels
    for pair in pairs:
        a, b = (np.ascontiguousarray(image, np.float32) for image in pair)
        height, width = a.shape
        reach, half = int(_DISPARITY_SHARE * width), _PATCH_PX // 2
        margin = half + _ROWS_PX
        if height <= 2 * margin or width <= 2 * margin:
            continue
        step = max(_PATCH_PX, int(np.sqrt((height - 2 * margin) * width / _MOST_PATCHES)))
        for v in range(margin, height - margin, step):
            for u in range(margin, width - margin, step):
                patch = a[v - half : v + half + 1, u - half : u + half + 1]
                start, end = max(0, u - reach - half), min(width, u + reach + half + 1)
                if patch.std() > 1.0:
                    score = cv2.matchTemplate(b[v - margin : v + margin + 1, start:end], patch, cv2.TM_CCOEFF_NORMED)
                    _, best, _, (x, y) = cv2.minMaxLoc(score)
                    rest = np.delete(score, np.s_[max(0, x - _BESIDE_PX) : x + _BESIDE_PX + 1], axis=1)
                    is_clear = best > max(_LEAST_CORRELATION, rest.max(initial=-1.0) + _CLEARLY)
                    if is_clear and 0 < y < 2 * _ROWS_PX:
                        shifts.append((start + x + half - u, y - _ROWS_PX + vertex(*score[y - 1 : y + 2, x].tolist())))
    if not shifts:
        return CameraOrder(0, 0.0, 0.0, 0.0)
    found = np.array(shifts, np.float64)
    low, middle, high = np.percentile(found[:, 1], [16, 50, 84])
    return CameraOrder(len(found), float(np.mean(found[:, 0] > offset_px + 0.5)), float(middle), float(high - low) / 2)
