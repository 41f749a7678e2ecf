# SPDX-License-Identifier: Apache-2.0
"""Computes covariates: known quantities of each pixel, such as depth or viewing angle, by which a residual is analysed.

Each covariate is one map [height][width] of an image, or one number of a frame. NaN = not defined there (the sky has no
depth).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from activestereo.effects.core.dots import DotView
from activestereo.effects.core.view import View

# Neighbours whose depths differ by more than this share form an edge.
_EDGE_STEP = 0.03


@dataclass(frozen=True)
class Covariate:
    """Describes a covariate. name: as in compare.json; words: for a reader; unit: '' for pure numbers; is_category: its
    values have no order."""

    name: str
    words: str
    unit: str
    is_category: bool = False


COVARIATES = (
    Covariate("depth", "depth", "m"),
    Covariate("radius", "radius", "of the half diagonal"),
    Covariate("column", "column", "px"),
    Covariate("row", "row", "px"),
    Covariate("incidence", "viewing angle", "deg"),
    Covariate("material", "material", "", is_category=True),
    Covariate("pattern_irradiance", "pattern irradiance", "1/m²"),
    Covariate("intensity", "expected signal", "DN"),
    Covariate("velocity", "image speed", "px/s"),
    Covariate("time", "time", "s"),
    Covariate("temperature", "temperature", "°C"),
    Covariate("exposure", "exposure x gain", "ms"),
    Covariate("disparity_fraction", "disparity fraction", "px"),
    Covariate("edge_distance", "distance to a depth edge", "px"),
)


def covariate_maps(
    view: View, material: np.ndarray, predicted_dn: np.ndarray, baseline_m: float
) -> dict[str, np.ndarray]:
    """Computes {covariate: float32 [height][width]} of one image. view: the camera's View of the scene; material: ids;
    predicted_dn: the expected image."""
    height, width = view.shape
    u, v = view.pixels()
    seen = view.depth_m > 0
    depth = np.where(seen, view.depth_m, np.nan)
    frame, points = view.frame, view.points()
    # 1. The angle between the ray to the camera and the surface's normal.
    distance = np.linalg.norm(points, axis=-1)
    cosine = np.abs((points * view.normal).sum(-1)) / np.where(distance > 0, distance, 1.0)
    incidence_deg = np.where(seen, np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0))), np.nan)
    # 2. The nominal projector's pattern x cos / d^2 at the surface, times the frame's power, shadows aside.
    way = np.linalg.inv(view.camera_to_projector)[:3, 3] - points
    distance = np.linalg.norm(way, axis=-1)
    cosine = np.maximum((way * view.normal).sum(-1), 0.0) / np.maximum(distance, 1e-9)
    irradiance = frame.projector_power * DotView.of(view).nominal() * cosine / np.maximum(distance, 1e-9) ** 2
    # 3. The image speed of the static scene: optical flow of the rig's own twist, pixels per second.
    speed: Any = 0.0
    if frame.is_moving:
        velocity, spin = view.left_to_camera[:3, :3] @ frame.camera_velocity.reshape(2, 3, 1)
        velocity, spin = velocity.ravel(), spin.ravel()
        velocity = velocity + np.cross(spin, -view.left_to_camera[:3, 3])
        flow = -(velocity + np.cross(spin, points))
        du = view.K[0, 0] * (flow[..., 0] - flow[..., 2] * points[..., 0] / depth) / depth
        dv = view.K[1, 1] * (flow[..., 1] - flow[..., 2] * points[..., 1] / depth) / depth
        speed = np.hypot(du, dv)
    # 4. The distance to the nearest jump in depth, pixels; the image's size without one.
    z = np.where(seen, view.depth_m, np.inf)
    edge = np.zeros(z.shape, dtype=bool)
    neighbours: Any = ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))
    for near, far in neighbours:
        low, high = np.minimum(z[near], z[far]), np.maximum(z[near], z[far])
        jump = np.isfinite(low) & (high > (1.0 + _EDGE_STEP) * low)
        edge[near] |= jump
        edge[far] |= jump
    maps = {
        "depth": depth,
        "radius": np.hypot(u - (width - 1) / 2, v - (height - 1) / 2) / np.hypot((width - 1) / 2, (height - 1) / 2),
        "column": u,
        "row": v,
        "incidence": incidence_deg,
        "material": np.where(seen, material, np.nan),
        "pattern_irradiance": np.where(seen, irradiance, np.nan),
        "intensity": predicted_dn,
        "velocity": speed,
        "time": frame.timestamp_s,
        "temperature": np.nan if frame.temperature_c is None else frame.temperature_c,
        "exposure": 1e3 * frame.exposure_gain,
        "disparity_fraction": np.mod(view.K[0, 0] * baseline_m / depth, 1.0),
        "edge_distance": distance_transform_edt(~edge) if edge.any() else float(max(z.shape)),
    }
    return {name: np.broadcast_to(np.asarray(value, dtype=np.float32), view.shape) for name, value in maps.items()}
