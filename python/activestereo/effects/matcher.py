# SPDX-License-Identifier: Apache-2.0
"""Effects of the device's matcher."""

import numpy as np
from scipy.ndimage import maximum_filter

from activestereo.effects.core.descriptor import EngineFault, Parameter, Stage, effect
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
