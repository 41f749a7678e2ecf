# SPDX-License-Identifier: Apache-2.0
"""Measures depth quality on a flat target. Metrics and names are those of Intel's Depth Quality Tool (librealsense,
tools/depth-quality), so that simulated and real sensors can be compared."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

_TRIMMED = 200  # one point in 200 is left out at each end of the depths: below 0.5 % and above 99.5 %


@dataclass(frozen=True)
class DepthQuality:
    """The metrics. NaN = not defined: no true distance, a single frame, or too few points for a plane."""

    fill_rate_percent: float  # pixels with a depth, of all in the region
    z_accuracy_percent: (
        float  # median signed error against the truth once the fitted plane is turned to face the camera; + is too far
    )
    plane_fit_rms_mm: float  # spatial noise: root mean square distance from the plane fitted to the points
    subpixel_rms_px: (
        float  # the same in disparity: B f / |point| against B f / |its foot on the plane|, as the tool computes it
    )
    temporal_noise_percent: float  # median over pixels of 100 * standard deviation / median over the frames


def region_of(shape: Sequence[int], fraction: float) -> tuple[slice, slice]:
    """Returns the centred rectangle with this fraction of height and width, as slices of rows and columns. The tool's
    usual fraction is 0.4."""
    if not 0 < fraction <= 1:
        raise ValueError(f"the region must be a fraction of the image in 0..1, not {fraction}")
    spans = [max(1, round(size * fraction)) for size in shape]
    rows, columns = (slice((n - s) // 2, (n - s) // 2 + s) for n, s in zip(shape, spans, strict=True))
    return rows, columns


def depth_quality(
    depth_m: ArrayLike, k: ArrayLike, baseline_m: float, true_distance_m: float | None = None,
    region: tuple[slice, slice] | None = None,
) -> DepthQuality:  # fmt: skip
    """Computes the metrics of depth maps [height, width] or [frames, height, width] in metres, 0 = none, as means over
    the frames.

    k: 3x3 in pixels. true_distance_m: the target's distance along the optical axis. region: slices of rows and columns,
    None = region_of(shape, 0.4).
    """
    frames = np.asarray(depth_m, dtype=np.float64)
    frames = frames[None] if frames.ndim == 2 else frames
    if frames.ndim != 3 or 0 in frames.shape:
        raise ValueError(f"depth must be [height, width] or [frames, height, width], not {np.shape(depth_m)}")
    if true_distance_m is not None and not true_distance_m > 0:
        raise ValueError(f"the true distance must be larger than 0 metres, not {true_distance_m}")
    rows, columns = region or region_of(frames.shape[1:], 0.4)
    matrix = np.asarray(k, dtype=np.float64)
    v, u = np.indices(frames.shape[1:], dtype=np.float64)
    rays = np.stack([(u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1], np.ones(u.shape)], axis=-1)
    rays, frames = rays[rows, columns], frames[:, rows, columns]
    single = np.array([_frame_quality(z, rays, matrix[0, 0] * baseline_m, true_distance_m) for z in frames])
    known = np.isfinite(single)  # each metric's mean over the frames that have it
    mean = np.where(known, single, 0).sum(axis=0) / np.maximum(1, known.sum(axis=0))
    fill, accuracy, plane_fit, subpixel = map(float, np.where(known.any(axis=0), mean, np.nan))
    # The temporal noise of the pixels that at least half of the frames measure.
    measured, temporal = frames > 0, np.nan
    often = 2 * measured.sum(axis=0) >= max(3, len(frames))
    if len(frames) > 1 and often.any():
        depths = np.where(measured, frames, np.nan)[:, often]
        temporal = float(np.median(100.0 * np.nanstd(depths, axis=0) / np.nanmedian(depths, axis=0)))
    return DepthQuality(fill, accuracy, plane_fit, subpixel, temporal)


def quality_table(quality: DepthQuality) -> str:
    """Returns a text with one line per metric, under the tool's names."""
    names = ("Fill-Rate", "Z Accuracy", "Plane Fit RMS Error", "Subpixel RMS Error", "Temporal Noise")
    units = ("%", "%", "mm", "pixel", "%")
    values = (getattr(quality, field.name) for field in fields(quality))
    rows = zip(names, values, units, strict=True)
    return "\n".join(
        f"{name:22}" + (f"{value:10.3f} {unit}" if np.isfinite(value) else f"{'-':>10}") for name, value, unit in rows
    )


def _frame_quality(
    z: np.ndarray, rays: np.ndarray, focal_baseline: float, true_distance_m: float | None
) -> tuple[float, float, float, float]:
    """Computes (fill rate %, Z accuracy %, plane-fit RMS mm, subpixel RMS px) of one frame. z: depths of the region, m.
    rays: its pixels' rays, scaled to z = 1. focal_baseline: px m."""
    measured = z > 0
    points = rays[measured] * z[measured][:, None]
    fill = 100.0 * measured.mean()
    plane = _fit_plane(points)
    if plane is None:
        return fill, np.nan, np.nan, np.nan
    normal, offset = plane
    points = points[np.argsort(points[:, 2], kind="stable")]
    outliers = len(points) // _TRIMMED
    points = points[outliers : len(points) - outliers]
    distance = points @ normal + offset
    feet = points - distance[:, None] * normal
    disparity_error = focal_baseline / np.linalg.norm(points, axis=1) - focal_baseline / np.linalg.norm(feet, axis=1)
    accuracy = np.nan
    if true_distance_m is not None:
        on_axis = -offset / normal[2]  # where the plane meets the optical axis
        accuracy = 100.0 * np.median(on_axis - true_distance_m + distance) / true_distance_m
    return fill, accuracy, 1e3 * np.sqrt(np.mean(distance**2)), np.sqrt(np.mean(disparity_error**2))


def _fit_plane(points: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Fits a plane to points [n, 3] by least squares of distances. Returns (unit normal away from the camera, offset)
    with normal . point + offset = 0, or None if there is no such plane."""
    if len(points) < 3:
        return None
    centre = points.mean(axis=0)
    spread, axes = np.linalg.eigh((points - centre).T @ (points - centre))
    if not spread[1] > 1e-12 * spread[2]:
        return None  # a line
    normal = axes[:, 0] * (1.0 if axes[2, 0] > 0 else -1.0)
    if abs(normal[2]) < 1e-6:
        return None  # seen edge on
    return normal, -float(normal @ centre)
