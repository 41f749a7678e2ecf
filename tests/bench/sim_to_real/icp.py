# SPDX-License-Identifier: Apache-2.0
"""Iterated closest points (Besl and McKay, PAMI 14, 1992; point to plane: Chen and Medioni, 1992), from a detector's
guess."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sim_to_real.clouds import LEAST, Cloud
from sim_to_real.objects import Surface
from sim_to_real.views import rotation

_STEPS, _WIDE_STEPS = 20, 8
_CAUCHY_M = 0.003
_LARGEST_STEP = 0.2  # rad, m


@dataclass(frozen=True)
class IcpSetting:
    """reach_m: largest distance of a pair; wider at first. loss: 'point', 'plane', or 'cauchy', which is 'plane' with
    Cauchy's weights."""

    reach_m: float
    loss: str


class Icp:
    SETTINGS = tuple(IcpSetting(reach, loss) for reach in (0.003, 0.01, 0.03) for loss in ("point", "plane", "cauchy"))

    def __init__(self, surface: Surface, setting: IcpSetting) -> None:
        self._surface, self._setting = surface, setting
        self._tree = cKDTree(surface.points)

    def find(self, cloud: Cloud, start: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """object_to_world, or None."""
        if len(cloud.points) < LEAST:
            return None
        return self.refine(cloud, start)[0]

    def refine(self, cloud: Cloud, start: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """(object_to_world, share of the cloud within reach)."""
        pose, share, reach = start.copy(), 0.0, self._setting.reach_m
        for step in range(_STEPS):
            points = (cloud.points - pose[:3, 3]) @ pose[:3, :3]
            distance, nearest = self._tree.query(points)
            is_pair = distance < reach * (1.0 + 2.0 * max(0.0, 1.0 - step / _WIDE_STEPS))
            share = float(np.mean(distance < reach))
            if is_pair.sum() < LEAST:
                break
            own = self._surface.points[nearest[is_pair]], self._surface.normals[nearest[is_pair]]
            pose = pose @ np.linalg.inv(self._motion(points[is_pair], *own))
        return pose, share

    def _motion(
        self, points: NDArray[np.float64], targets: NDArray[np.float64], normals: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """4x4 that takes points nearer to the surface."""
        if self._setting.loss == "point":
            return best_motion(points, targets)
        residuals = np.einsum("ij,ij->i", points - targets, normals)
        weights = 1.0 / (1.0 + (residuals / _CAUCHY_M) ** 2) if self._setting.loss == "cauchy" else np.ones(len(points))
        jacobian = np.concatenate([np.cross(points, normals), normals], axis=1)
        normal_matrix = (jacobian * weights[:, None]).T @ jacobian + 1e-6 * len(points) * np.eye(6)
        step = np.linalg.solve(normal_matrix, -(jacobian * weights[:, None]).T @ residuals)
        step = np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
        motion = np.eye(4)
        motion[:3, :3], motion[:3, 3] = rotation(step[:3]), step[3:]
        return motion


def best_motion(points: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rigid motions [..., 4, 4] that take points [..., n, 3] nearest to targets (Kabsch, Acta Cryst. A32, 1976)."""
    a, b = points.mean(axis=-2, keepdims=True), targets.mean(axis=-2, keepdims=True)
    u, _, vt = np.linalg.svd(np.swapaxes(points - a, -1, -2) @ (targets - b))
    mirror = np.ones(u.shape[:-1])
    mirror[..., 2] = np.linalg.det(u @ vt)
    turn = np.swapaxes((u * mirror[..., None, :]) @ vt, -1, -2)
    out = np.zeros((*u.shape[:-2], 4, 4))
    out[..., :3, :3], out[..., 3, 3] = turn, 1.0
    out[..., :3, 3] = (b - a @ np.swapaxes(turn, -1, -2))[..., 0, :]
    return out
