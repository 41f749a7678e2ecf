# SPDX-License-Identifier: Apache-2.0
"""Noise that other simulators put on the depth of one view: the baselines that matched stereo is compared with.

All take depth float32 [E, height, width] in metres, 0 = nothing there, and return the same, 0 = no measurement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.common.window_statistics import mean_and_deviation
from activestereo.sensor.gbuffer.rig import inverse_depth
from activestereo.sensor.gbuffer.warp import in_front, warped

Depth = NDArray[np.float32]
# Kinect's disparities come in eighths of a pixel.
_KINECT_STEPS = 8.0
_KINECT_SHIFT_PX, _KINECT_SIGMA_STEPS = 0.5, 1.0 / 6.0
# Redwood's simulator of depth noise; its lens table is a file of one device and is left out.
_REDWOOD_SHIFT_PX, _REDWOOD_SIGMA_PX, _REDWOOD_FARTHEST_M = 0.25, 0.027778, 10.0
# Intel, "Best-known methods for tuning RealSense D400": RMS of subpixels of a passive, well textured plane.
_DATASHEET_SUBPIXEL = 0.08
# What a texture varies by within the window, of 255 grey levels.
_TEXTURE_WINDOW, _TEXTURE_LEVELS = 7, 4.0


def gaussian(depth: Depth, sigma_m_at_1_m: float, random: np.random.Generator) -> Depth:
    """Noise that grows with the square of the depth."""
    noise = random.standard_normal(depth.shape, np.float32)
    return np.where(depth > 0, depth + np.float32(sigma_m_at_1_m) * depth**2 * noise, 0.0).astype(np.float32)


def datasheet(depth: Depth, focal_baseline_px_m: float, random: np.random.Generator) -> Depth:
    """sigma(z) = z^2 * subpixel / (f B), as the makers of stereo cameras state it."""
    return gaussian(depth, _DATASHEET_SUBPIXEL / focal_baseline_px_m, random)


def simkinect(depth: Depth, focal_baseline_px_m: float, random: np.random.Generator) -> Depth:
    """Barron and Malik 2013, as Handa et al. 2014 have it: pixels shift, disparity is jittered and rounded."""
    shifted = _shifted(depth, _KINECT_SHIFT_PX, random)
    jitter = _KINECT_SIGMA_STEPS * random.standard_normal(depth.shape)
    return _rounded(shifted, focal_baseline_px_m, jitter / _KINECT_STEPS, 1.0 / _KINECT_STEPS)


def redwood(depth: Depth, focal_baseline_px_m: float, random: np.random.Generator) -> Depth:
    """Choi et al. 2015, as Habitat and Open3D have it: every other pixel, shifted, its disparity jittered and
    rounded; nothing from 10 m on."""
    rows, columns = (np.arange(size) // 2 * 2 for size in depth.shape[1:])
    coarse = _shifted(depth, _REDWOOD_SHIFT_PX, random, rows, columns)
    jitter = _REDWOOD_SIGMA_PX * random.standard_normal(depth.shape)
    near = np.where(coarse < _REDWOOD_FARTHEST_M, coarse, np.float32(0.0))
    return _rounded(near, focal_baseline_px_m, jitter, 1.0 / _KINECT_STEPS)


@dataclass(frozen=True)
class IsaacSettings:
    """Isaac Sim's single-view depth sensor by default (ovrtx 0.7.0, sensors/visual/depth_camera; the numbers by a
    user's note on Isaac Sim 6.0.1): noiseMean is the step of disparity. needs_texture: confidence 0.70 drops pixels
    without texture, of an untextured wall at 1 m all; its law is not published, ours is a contrast in the picture."""

    step_px: float = 0.25
    sigma_px: float = 0.25
    max_disparity_px: float = 110.0
    min_distance_m: float = 0.5
    needs_texture: bool = True


def isaac(
    depth: Depth, gray: NDArray[np.float32] | None, focal_px: float, baseline_m: float, settings: IsaacSettings,
    random: np.random.Generator,
) -> Depth:  # fmt: skip
    """gray: the picture, 0..1, for settings.needs_texture. What the second view does not see is dropped."""
    inverse = inverse_depth(depth)
    disparity = focal_px * baseline_m * inverse
    beside = warped(inverse, focal_px, baseline_m).inverse_depth
    x = np.arange(depth.shape[-1]) - disparity
    nearer_px = focal_px * baseline_m * in_front(beside, x, inverse)
    is_kept = (depth >= settings.min_distance_m) & (x >= 0.0) & (nearer_px < 1.0)
    if settings.needs_texture:
        if gray is None:
            raise ValueError("IsaacSettings.needs_texture: the picture is missing")
        _, contrast = mean_and_deviation(gray, (1, _TEXTURE_WINDOW, _TEXTURE_WINDOW))
        is_kept &= contrast * 255.0 > _TEXTURE_LEVELS
    jitter = settings.sigma_px * random.standard_normal(depth.shape)
    is_kept &= disparity < settings.max_disparity_px
    return _rounded(np.where(is_kept, depth, np.float32(0.0)), focal_px * baseline_m, jitter, settings.step_px)


def _shifted(
    depth: Depth, sigma_px: float, random: np.random.Generator, rows: NDArray[np.intp] | None = None,
    columns: NDArray[np.intp] | None = None,
) -> Depth:  # fmt: skip
    """Each pixel's value from a place beside it."""
    _, height, width = depth.shape
    v = np.arange(height) if rows is None else rows
    u = np.arange(width) if columns is None else columns
    at = [random.normal(0.0, sigma_px, depth.shape) for _ in range(2)]
    row = np.clip(np.rint(v[:, None] + at[0]), 0, height - 1).astype(np.intp)
    column = np.clip(np.rint(u + at[1]), 0, width - 1).astype(np.intp)
    return np.asarray(depth[np.arange(len(depth))[:, None, None], row, column])


def _rounded(depth: Depth, focal_baseline_px_m: float, jitter_px: NDArray[np.float64], step_px: float) -> Depth:
    """Through disparities in whole steps."""
    with np.errstate(divide="ignore", invalid="ignore"):
        disparity = np.rint((focal_baseline_px_m / depth + jitter_px) / step_px) * step_px
        return np.where((depth > 0) & (disparity > 0), focal_baseline_px_m / disparity, 0.0).astype(np.float32)
