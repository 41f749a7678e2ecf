# SPDX-License-Identifier: Apache-2.0
"""Effects on disparities: of the device's matcher, then of its filters of depth."""

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from activestereo.effects.core.descriptor import EngineFault, Parameter, Stage, Unjudged, effect
from activestereo.effects.core.view import View


@effect(
    stage=Stage.DISPARITY, family="matcher",
    finding="Near things grow at their edges in the device's depth",
    source="Scharstein and Szeliski 2002, A taxonomy: foreground fattening by half a window",
    image_only="the matcher's window fattens edges itself; simsense has no field for a device's additional fattening",
    parameters=[Parameter("radius_px", "px", high=8.0, typical=1.0)],
)  # fmt: skip
def edge_fattening(disparity: np.ndarray, view: View, radius_px: float) -> np.ndarray:
    """Next to a depth edge the far side takes the near side's disparity, over radius_px. Pixels without a match stay
    so."""
    whole = int(radius_px)
    share = radius_px - whole
    grown = [disparity if r == 0 else maximum_filter(disparity, size=2 * r + 1) for r in (whole, whole + (share > 0))]
    return np.where(disparity > 0, (1.0 - share) * grown[0] + share * grown[1], 0.0)


@effect(
    stage=Stage.DISPARITY, family="matcher",
    finding="The device's matches belong to points beside their pixels",
    source="Xiong and Matthies 1997, Error analysis of a real-time stereo system: up to 0.3 px on slants",
    image_only="simsense's matches belong to the pixel; a device's bias has no field",
    judged=(EngineFault(displaces=True),),
    parameters=[
        Parameter("offset_px", "px", low=-3.0, high=3.0, typical=0.5,
                  source="where in the window the match belongs, to the right"),
        Parameter("offset_down_px", "px", low=-3.0, high=3.0, typical=0.5, source="the same, downwards"),
    ],
)  # fmt: skip
def foreshortening_bias(disparity: np.ndarray, view: View, offset_px: float, offset_down_px: float) -> np.ndarray:
    """A match belongs to a point beside the pixel, or below it. The error is that offset times the disparity's slope
    along it."""
    normal, points = view.normal, view.points()
    plane_m = (normal * points).sum(-1)  # the tangent plane's distance: 1/z = normal . (x, y, 1) / plane_m
    known = (disparity > 0) & (np.abs(plane_m) > 1e-3 * np.maximum(view.depth_m, 1e-6))
    per_px = view.baseline_m / np.where(known, plane_m, 1.0)
    right, down = (
        np.clip(x, -1.0, 1.0) for x in (per_px * normal[..., 0], per_px * normal[..., 1] * view.K[0, 0] / view.K[1, 1])
    )
    return np.where(known, np.maximum(disparity + offset_px * right + offset_down_px * down, 0.0), disparity)


@effect(
    stage=Stage.DISPARITY, family="matcher",
    finding="The device's disparities prefer some fractions of a pixel",
    source="Shimizu and Okutomi 2001, Precise sub-pixel estimation on area-based matching; 0.03-0.15 px on real pairs",
    image_only="simsense's sub-pixel step has its own, smaller bias; a device's has no field",
    judged=(EngineFault(is_matcher_choice=True),),
    parameters=[
        Parameter("amplitude_px", "px", low=-0.15, high=0.15, typical=0.04, source="positive: towards whole pixels"),
    ],
)  # fmt: skip
def pixel_locking(disparity: np.ndarray, view: View, amplitude_px: float) -> np.ndarray:
    """The sub-pixel fit errs by a sine of the disparity. Planes get stairs of one pixel of disparity."""
    return disparity - amplitude_px * np.sin(2 * np.pi * disparity) * (disparity > 0)


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
