"""Disparity errors of slanted surfaces."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect


@effect(
    "foreshortening_bias",
    stage=Stage.DISPARITY,
    family="matcher",
    source="Xiong and Matthies 1997, Error analysis of a real-time stereo system: up to 0.3 px on slants",
    parameters=[Parameter("offset_px", "px", neutral=0.0, low=-3.0, high=3.0, typical=0.5, source="where in the window the match belongs")],
)
def foreshortening_bias(disparity, view, offset_px):
    """A match belongs to a point offset_px beside the pixel: the error is that times the disparity's slope along the row."""
    normal, points = view.normal, view.points()
    plane_m = (normal * points).sum(-1)  # the tangent plane's distance: 1/z = normal . (x, y, 1) / plane_m
    told = (disparity > 0) & (np.abs(plane_m) > 1e-3 * np.maximum(view.depth_m, 1e-6))
    slope = view.baseline_m * normal[..., 0] / np.where(told, plane_m, 1.0)
    return np.where(told, np.maximum(disparity + offset_px * np.clip(slope, -1.0, 1.0), 0.0), disparity)
