# SPDX-License-Identifier: Apache-2.0
"""Simulates a device's average over the frames of its stream."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.judging import Unjudged
from activestereo.effects.core.view import View


@effect(
    "temporal_filter",
    stage=Stage.DISPARITY,
    family="filter of depth",
    finding="The device averages its disparities over frames",
    source="librealsense doc/post-processing-filters.md: exponential average, alpha 0.4, delta 20 of 1/32 px, "
    "persistence",
    judged=(Unjudged("it shows in how consecutive frames resemble each other, which captures of single views do not"),),
    parameters=[
        Parameter("alpha", "1", neutral=1.0, low=0.05, high=1.0, typical=0.6, source="weight of the new frame"),
        Parameter(
            "delta_px", "px", neutral=0.0, low=0.0, high=3.125, typical=0.625,
            source="a larger change is taken as it is",
        ),
        Parameter(
            "persists", "1", neutral=0.0, low=0.0, high=1.0, typical=1.0, choice=True,
            source="1: a hole keeps the last disparity",
        ),
    ],
    remembers=True,
    image_only="what a device's firmware does after matching is no part of simsense",
)  # fmt: skip
def temporal_filter(
    disparity: np.ndarray, view: View, alpha: float, delta_px: float, persists: float
) -> np.ndarray:
    """Disparities are averaged exponentially over frames where they change by less than delta_px: the variance of a
    scene at rest is alpha / (2 - alpha) of a frame's, and slow motion drags. Needs a stream, whose first frame stays
    as it is."""
    before = view.before
    if before is None:
        return disparity
    steady = (disparity > 0) & (before > 0) & (np.abs(disparity - before) < delta_px)
    out = np.where(steady, alpha * disparity + (1.0 - alpha) * before, disparity)
    return np.where((disparity > 0) | (before <= 0), out, before) if persists else out
