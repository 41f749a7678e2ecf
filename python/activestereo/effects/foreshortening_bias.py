# SPDX-License-Identifier: Apache-2.0
"""Simulates disparity errors of slanted surfaces."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.judging import EngineFault
from activestereo.effects.core.view import View


@effect(
    "foreshortening_bias",
    stage=Stage.DISPARITY,
    family="matcher",
    finding="The device's matches belong to points beside their pixels",
    source="Xiong and Matthies 1997, Error analysis of a real-time stereo system: up to 0.3 px on slants",
    judged=(EngineFault(displaces=True),),
    parameters=[
        Parameter(
            "offset_px", "px", neutral=0.0, low=-3.0, high=3.0, typical=0.5,
            source="where in the window the match belongs, to the right",
        ),
        Parameter("offset_down_px", "px", neutral=0.0, low=-3.0, high=3.0, typical=0.5, source="the same, downwards"),
    ],
    image_only="simsense's matches belong to the pixel; a device's bias has no field",
)  # fmt: skip
def foreshortening_bias(disparity: np.ndarray, view: View, offset_px: float, offset_down_px: float) -> np.ndarray:
    """A match belongs to a point beside the pixel, or below it: the error is that offset times the disparity's slope
    along it."""
    normal, points = view.normal, view.points()
    plane_m = (normal * points).sum(-1)  # the tangent plane's distance: 1/z = normal . (x, y, 1) / plane_m
    known = (disparity > 0) & (np.abs(plane_m) > 1e-3 * np.maximum(view.depth_m, 1e-6))
    per_px = view.baseline_m / np.where(known, plane_m, 1.0)
    right, down = (
        np.clip(x, -1.0, 1.0) for x in (per_px * normal[..., 0], per_px * normal[..., 1] * view.K[0, 0] / view.K[1, 1])
    )
    return np.where(known, np.maximum(disparity + offset_px * right + offset_down_px * down, 0.0), disparity)
