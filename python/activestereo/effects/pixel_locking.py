# SPDX-License-Identifier: Apache-2.0
"""Simulates disparities drawn to whole pixels."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.judging import EngineFault
from activestereo.effects.core.view import View


@effect(
    "pixel_locking",
    stage=Stage.DISPARITY,
    family="matcher",
    finding="The device's disparities prefer some fractions of a pixel",
    source="Shimizu and Okutomi 2001, Precise sub-pixel estimation on area-based matching; 0.03-0.15 px on real pairs",
    judged=(EngineFault(is_matcher_choice=True),),
    parameters=[
        Parameter(
            "amplitude_px", "px", neutral=0.0, low=-0.15, high=0.15, typical=0.04,
            source="positive: towards whole pixels",
        )
    ],
    image_only="simsense's sub-pixel step has its own, smaller bias; a device's has no field",
)  # fmt: skip
def pixel_locking(disparity: np.ndarray, view: View, amplitude_px: float) -> np.ndarray:
    """The sub-pixel fit errs by a sine of the disparity: planes get stairs of one pixel of disparity."""
    return disparity - amplitude_px * np.sin(2 * np.pi * disparity) * (disparity > 0)
