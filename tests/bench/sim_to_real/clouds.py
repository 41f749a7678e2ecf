# SPDX-License-Identifier: Apache-2.0
"""Points of an object in a depth picture, with normals, at a detector's guess."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

# Nearer points belong to the table; points farther from the detector's guess to another object.
_TABLE_M, _REGION_M = 0.006, 0.1
_MOST, _NEIGHBOURS = 400, 16
LEAST = 30  # fewer points tell no pose


@dataclass(frozen=True)
class Cloud:
    """points, normals: float64 [n, 3] in the world; normals are unit and face the camera."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]


def cloud(
    depth_m: NDArray[np.float32],
    k: NDArray[np.float64],
    camera_to_world: NDArray[np.float64],
    guess_m: NDArray[np.float64],
) -> Cloud:
    """The points of a depth picture [height, width], 0 = no measurement: at most 400 points above the table within 0.1
    m (across) of guess_m. Empty with fewer than LEAST."""
    v, u = np.nonzero(depth_m > 0)
    z = depth_m[v, u].astype(np.float64)
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones(len(z))], axis=1)
    points = (rays * z[:, None]) @ camera_to_world[:3, :3].T + camera_to_world[:3, 3]
    across = np.linalg.norm(points[:, :2] - guess_m[:2], axis=1)
    points = points[(points[:, 2] > _TABLE_M) & (across < _REGION_M) & (points[:, 2] < guess_m[2] + _REGION_M)]
    if len(points) < LEAST:
        return Cloud(np.empty((0, 3)), np.empty((0, 3)))
    normals = _normals(points, camera_to_world[:3, 3])
    chosen = np.random.default_rng(0).permutation(len(points))[:_MOST]
    return Cloud(points[chosen], normals[chosen])


def _normals(points: NDArray[np.float64], side: NDArray[np.float64]) -> NDArray[np.float64]:
    """The normal of the plane through each point's neighbours."""
    _, near = cKDTree(points).query(points, min(_NEIGHBOURS, len(points)))
    around = points[near] - points[near].mean(axis=1, keepdims=True)
    _, directions = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    normals = directions[:, :, 0]
    away = np.einsum("ij,ij->i", normals, points - side) > 0.0
    normals[away] *= -1.0
    return np.asarray(normals)
