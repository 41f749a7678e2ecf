# SPDX-License-Identifier: Apache-2.0
"""The distance between the errors of two kinds of depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.noise_profiles.rooms import Views

# Errors count up to this: mismatches of tens of pixels, which no model of noise has, would outweigh all others.
_MOST_PX = 2.0
_QUANTILES = (np.arange(1000) + 0.5) / 1000.0


@dataclass(frozen=True)
class Distance:
    """error_px: the 1-Wasserstein distance between the distributions of the errors of depth as disparities, each cut
    off at 2 px, over pixels that are measured. holes: by how much the shares of pixels without depth differ."""

    error_px: float
    holes: float

    @property
    def total(self) -> float:
        """A pixel without depth weighs as much as one that is wrong by 1 px."""
        return self.error_px + self.holes


def distance(views: Views, depth_m: NDArray[np.float32]) -> Distance:
    """The distance of depth [rooms, height, width], metres, 0 = none, from the measured one; mean of the rooms."""
    rooms = [
        _room_distance(truth, found, depth, views)
        for truth, found, depth in zip(views.truth_m, views.found_m, depth_m, strict=True)
    ]
    return Distance(float(np.mean([r.error_px for r in rooms])), float(np.mean([r.holes for r in rooms])))


def _room_distance(
    truth: NDArray[np.float32], found: NDArray[np.float32], depth: NDArray[np.float32], views: Views
) -> Distance:
    is_there = (truth >= views.near_m) & (truth <= views.far_m)
    errors: list[NDArray[np.float64]] = []
    holes: list[float] = []
    for image in (found, depth):
        is_valid = is_there & (image > 0)
        px = views.focal_baseline_px_m * (1.0 / image[is_valid].astype(np.float64) - 1.0 / truth[is_valid])
        errors.append(np.quantile(np.clip(px, -_MOST_PX, _MOST_PX), _QUANTILES) if px.size else np.zeros(1000))
        holes.append(1.0 - is_valid.sum() / max(int(is_there.sum()), 1))
    return Distance(float(np.mean(np.abs(errors[0] - errors[1]))), abs(holes[0] - holes[1]))
