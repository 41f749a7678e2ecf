# SPDX-License-Identifier: Apache-2.0
"""Where a unit that stands in the world points: its axes, from azimuth, elevation and roll of its beam."""

from __future__ import annotations

import numpy as np


def axes(azimuth_rad: float, elevation_rad: float, roll_rad: float) -> np.ndarray:
    """Rotation [3][3] from a unit's axes (right, down, along its beam) to the world's. azimuth: of the beam about the
    world's y axis from z towards x; elevation: above the xz plane; roll: about the beam, right-handed.
    """
    level = np.cos(elevation_rad)
    along = np.array([level * np.sin(azimuth_rad), np.sin(elevation_rad), level * np.cos(azimuth_rad)])
    right = np.array([-np.cos(azimuth_rad), 0.0, np.sin(azimuth_rad)])
    down = np.cross(along, right)
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    return np.stack([c * right + s * down, c * down - s * right, along], axis=1)


def angles(along: np.ndarray) -> tuple[float, float]:
    """(azimuth, elevation) of a direction."""
    x, y, z = along / np.linalg.norm(along)
    return float(np.arctan2(x, z)), float(np.arcsin(np.clip(y, -1.0, 1.0)))
