# SPDX-License-Identifier: Apache-2.0
"""Effects of the device's filters of depth."""

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from activestereo.effects.core.descriptor import EngineFault, Parameter, Stage, Unjudged, effect
from activestereo.effects.core.view import View

_FIRMWARE = "what a device's firmware does after matching is no part of simsense"
_LEFT, _FARTHEST = 0.0, 1.0
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=bool)


@effect(
    stage=Stage.DISPARITY, family="filter of depth",
    finding="The device fills holes with the depth beside them",
    source="librealsense doc/post-processing-filters.md: from the left, the farthest or the nearest neighbour",
    image_only=_FIRMWARE,
    judged=(Unjudged("it gives holes a depth, and depth is judged where both engines measured one"),),
    parameters=[
        Parameter("reach_px", "px", high=4096.0, typical=16.0,
                  source="how far a hole is filled; librealsense's own has no end"),
        Parameter("neighbour", "1", high=2.0, typical=1.0, choice=True,
                  source="0: the one on the left; 1: the farthest around; 2: the nearest"),
    ],
)  # fmt: skip
def hole_filling(disparity: np.ndarray, view: View, reach_px: float, neighbour: float) -> np.ndarray:
    """Pixels without a match take a neighbour's disparity, up to reach_px from what was measured. Shadows beside near
    things get a depth that nobody measured. Measured pixels stay."""
    if neighbour == _LEFT:
        columns = np.broadcast_to(np.arange(disparity.shape[1]), disparity.shape)
        last = np.maximum.accumulate(np.where(disparity > 0, columns, -1), axis=1)
        filled = (disparity <= 0) & (last >= 0) & (columns - last <= int(reach_px))
        return np.where(filled, np.take_along_axis(disparity, np.maximum(last, 0), axis=1), disparity)
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


# Neighbours this much apart in disparity belong to other surfaces and are not averaged.
_EDGE_PX = 1.0


@effect(
    stage=Stage.DISPARITY, family="matcher",
    finding="The device smooths and rounds its disparities",
    source="librealsense post-processing filters: edge-preserving smoothing; disparities in 1/32 px",
    image_only=_FIRMWARE,
    judged=(EngineFault(is_matcher_choice=True),),
    parameters=[
        Parameter("smoothing_px", "px", high=8.0, typical=1.5),
        Parameter("step_px", "px", high=1.0, typical=0.0625, source="disparities come in multiples of it"),
    ],
)  # fmt: skip
def post_filter(disparity: np.ndarray, view: View, smoothing_px: float, step_px: float) -> np.ndarray:
    """A filter smooths disparities within surfaces and rounds them to steps. Their noise is correlated and their
    histogram is a comb."""
    out = disparity
    matched = disparity > 0
    if smoothing_px > 0.0:
        weight = gaussian_filter(matched.astype(np.float64), smoothing_px)
        mean = gaussian_filter(np.where(matched, disparity, 0.0), smoothing_px) / np.maximum(weight, 1e-12)
        out = np.where(matched & (np.abs(mean - disparity) < _EDGE_PX), mean, disparity)
    if step_px > 0.0:
        out = np.where(matched, np.maximum(np.rint(out / step_px), 1.0) * step_px, 0.0)
    return out


@effect(
    stage=Stage.DISPARITY, family="filter of depth", remembers=True,
    finding="The device averages its disparities over frames",
    source="librealsense doc/post-processing-filters.md: exponential average, alpha 0.4, delta 20 of 1/32 px, "
           "persistence",
    image_only=_FIRMWARE,
    judged=(Unjudged("it shows in how consecutive frames resemble each other, which captures of single views do not"),),
    parameters=[
        Parameter("alpha", "1", neutral=1.0, low=0.05, high=1.0, typical=0.6, source="weight of the new frame"),
        Parameter("delta_px", "px", high=3.125, typical=0.625, source="a larger change is taken as it is"),
        Parameter("persists", "1", high=1.0, typical=1.0, choice=True, source="1: a hole keeps the last disparity"),
    ],
)  # fmt: skip
def temporal_filter(disparity: np.ndarray, view: View, alpha: float, delta_px: float, persists: float) -> np.ndarray:
    """A filter averages disparities exponentially over frames, where they change by less than delta_px. A scene at rest
    has alpha / (2 - alpha) of a frame's variance; slow motion drags. The filter needs a stream, whose first frame stays
    as it is."""
    before = view.before
    if before is None:
        return disparity
    steady = (disparity > 0) & (before > 0) & (np.abs(disparity - before) < delta_px)
    out = np.where(steady, alpha * disparity + (1.0 - alpha) * before, disparity)
    return np.where((disparity > 0) | (before <= 0), out, before) if persists else out
