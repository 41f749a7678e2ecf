# SPDX-License-Identifier: Apache-2.0
"""Tells which image of an infrared pair is the left camera's, and whether both images' rows match. Finds patches of the
first image in the second one, and needs no calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.common.parabola import vertex

_PATCH_PX, _ROWS_PX = 25, 6
_DISPARITY_SHARE = 0.25  # of the width: a D435 at 0.2 m
_MOST_PATCHES, _LEAST_PATCHES = 240, 30
_LEAST_CORRELATION = 0.7
# A pair is swapped if so many patches lie further right in the second image: noise alone gives a half.
_SWAPPED = 0.8


@dataclass(frozen=True)
class CameraOrder:
    """patches: number of patches found again. nearer_right: share of them further right in the right image, at which no
    surface can lie. row_offset_px: median by which the right image's rows lie lower. row_spread_px: half of its middle
    68 %."""

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
    """The CameraOrder of (left, right) images [height][width] of one size. offset_px: cx of the right camera less that
    of the left one: infinitely far things lie so much further right."""
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
                    if best > _LEAST_CORRELATION and 0 < y < 2 * _ROWS_PX:
                        shifts.append((start + x + half - u, y - _ROWS_PX + vertex(*score[y - 1 : y + 2, x].tolist())))
    if not shifts:
        return CameraOrder(0, 0.0, 0.0, 0.0)
    found = np.array(shifts, np.float64)
    low, middle, high = np.percentile(found[:, 1], [16, 50, 84])
    return CameraOrder(len(found), float(np.mean(found[:, 0] > offset_px + 0.5)), float(middle), float(high - low) / 2)
