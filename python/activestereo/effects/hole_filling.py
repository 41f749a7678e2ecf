# SPDX-License-Identifier: Apache-2.0
"""Simulates a device that fills holes of the depth image with their neighbours' depth."""

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.judging import Unjudged
from activestereo.effects.core.view import View

_LEFT, _FARTHEST = 0.0, 1.0
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=bool)


@effect(
    "hole_filling",
    stage=Stage.DISPARITY,
    family="filter of depth",
    finding="The device fills holes with the depth beside them",
    source="librealsense doc/post-processing-filters.md: from the left, the farthest or the nearest neighbour",
    judged=(Unjudged("it gives holes a depth, and depth is judged where both engines measured one"),),
    parameters=[
        Parameter(
            "reach_px", "px", neutral=0.0, low=0.0, high=4096.0, typical=16.0,
            source="how far a hole is filled; librealsense's own has no end",
        ),
        Parameter(
            "neighbour", "1", neutral=0.0, low=0.0, high=2.0, typical=1.0, choice=True,
            source="0: the one on the left; 1: the farthest around; 2: the nearest",
        ),
    ],
    image_only="what a device's firmware does after matching is no part of simsense",
)  # fmt: skip
def hole_filling(disparity: np.ndarray, view: View, reach_px: float, neighbour: float) -> np.ndarray:
    """Pixels without a match take a neighbour's disparity, up to reach_px from what was measured: shadows beside near
    things get a depth that nobody measured. Measured pixels stay."""
    if neighbour == _LEFT:
        return _from_the_left(disparity, int(reach_px))
    out = disparity
    for _ in range(int(reach_px)):
        if neighbour == _FARTHEST:
            around = minimum_filter(np.where(out > 0, out, np.inf), footprint=_CROSS)
        else:
            around = maximum_filter(out, footprint=_CROSS)
        filled = (out <= 0) & (around > 0) & np.isfinite(around)
        if not filled.any():
            break
        out = np.where(filled, around, out)
    return out


def _from_the_left(disparity: np.ndarray, reach_px: int) -> np.ndarray:
    columns = np.broadcast_to(np.arange(disparity.shape[1]), disparity.shape)
    last = np.maximum.accumulate(np.where(disparity > 0, columns, -1), axis=1)
    filled = (disparity <= 0) & (last >= 0) & (columns - last <= reach_px)
    return np.where(filled, np.take_along_axis(disparity, np.maximum(last, 0), axis=1), disparity)
