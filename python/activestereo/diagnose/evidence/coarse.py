# SPDX-License-Identifier: Apache-2.0
"""Blurs observations and thins out their pixels. Where an object is off by more than a dot's width, only blurred images
have slopes that lead to its place."""

from dataclasses import replace

import numpy as np

from activestereo.diagnose.evidence.observation import Observation
from activestereo.effects.core.layers import Layers
from activestereo.effects.core.resample import blur

# Least known share of a blurred pixel, against division by zero.
_LEAST = 1e-6


def coarse(o: Observation, sigma_px: float) -> Observation:
    """Returns the observation under a Gaussian blur of measured image, lights and slopes. Of the pixels, only every
    sigma_px-th of every sigma_px-th row counts."""
    known = o.view.known
    share: np.ndarray | float = 1.0 if known is None else np.maximum(blur(known.astype(np.float32), sigma_px), _LEAST)

    def seen(image: np.ndarray) -> np.ndarray:
        inside = image if known is None else np.where(known, image, 0.0)
        return blur(np.asarray(inside, dtype=np.float32), sigma_px) / share

    direct, indirect, ambient, flat = (
        seen(getattr(o.layers, name)).astype(np.float64) for name in ("direct", "indirect", "ambient", "flat")
    )
    step, (height, width) = max(1, round(sigma_px)), o.measured.shape
    at = np.add.outer(np.arange(step // 2, height, step) * width, np.arange(step // 2, width, step)).ravel()
    return replace(
        o,
        layers=Layers(direct, indirect, ambient, flat, o.layers.depth_m, o.layers.normal, o.layers.material),
        measured=seen(o.measured).astype(np.float64),
        focal_slope=seen(o.focal_slope),
        geometry_slopes=np.stack([seen(slope) for slope in o.geometry_slopes]),
        pick=at if known is None else at[known.ravel()[at]],
    )
