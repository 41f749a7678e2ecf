# SPDX-License-Identifier: Apache-2.0
"""Simulates filters that a device applies to disparity after matching."""

import numpy as np
from scipy.ndimage import gaussian_filter

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.judging import EngineFault
from activestereo.effects.core.view import View

# Neighbours this much apart in disparity belong to other surfaces and are not averaged.
_EDGE_PX = 1.0


@effect(
    "post_filter",
    stage=Stage.DISPARITY,
    family="matcher",
    finding="The device smooths and rounds its disparities",
    source="librealsense post-processing filters: edge-preserving smoothing; disparities in 1/32 px",
    judged=(EngineFault(is_matcher_choice=True),),
    parameters=[
        Parameter("smoothing_px", "px", neutral=0.0, low=0.0, high=8.0, typical=1.5),
        Parameter(
            "step_px", "px", neutral=0.0, low=0.0, high=1.0, typical=0.0625,
            source="disparities come in multiples of it",
        ),
    ],
    image_only="what a device's firmware does after matching is no part of simsense",
)  # fmt: skip
def post_filter(disparity: np.ndarray, view: View, smoothing_px: float, step_px: float) -> np.ndarray:
    """Disparities are smoothed within surfaces and rounded to steps: their noise is correlated and their histogram a
    comb."""
    out = disparity
    matched = disparity > 0
    if smoothing_px > 0.0:
        weight = gaussian_filter(matched.astype(np.float64), smoothing_px)
        mean = gaussian_filter(np.where(matched, disparity, 0.0), smoothing_px) / np.maximum(weight, 1e-12)
        out = np.where(matched & (np.abs(mean - disparity) < _EDGE_PX), mean, disparity)
    if step_px > 0.0:
        out = np.where(matched, np.maximum(np.rint(out / step_px), 1.0) * step_px, 0.0)
    return out
