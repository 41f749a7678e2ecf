# SPDX-License-Identifier: Apache-2.0
"""Templates and RANSAC. The templates are fast point feature histograms of an object's views from all around. RANSAC
forms poses from three matched pairs each and keeps the pose that most points agree with; ICP refines it (Fischler and
Bolles, CACM 24, 1981; the pipeline of Rusu et al., ICRA 2009). Needs no guess."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sim_to_real.clouds import LEAST, Cloud
from sim_to_real.features import histograms
from sim_to_real.icp import Icp, IcpSetting, best_motion
from sim_to_real.objects import Surface

_DIRECTIONS, _TEMPLATE_POINTS, _CELL_M, _BEHIND_M = 26, 250, 0.004, 0.004
_DRAWS, _TRIED, _CANDIDATES, _CHECKED = 6000, 200, 4, 120
_SHORTEST_M, _STRETCH = 0.02, 0.15


@dataclass(frozen=True)
class TemplateSetting:
    """radius_m: of the features. reach_m: distance limit of agreement and of the ICP."""

    radius_m: float
    reach_m: float


class Template:
    SETTINGS = tuple(TemplateSetting(radius, reach) for radius in (0.015, 0.03) for reach in (0.003, 0.006, 0.012))

    def __init__(self, surface: Surface, setting: TemplateSetting) -> None:
        self._setting = setting
        self._icp = Icp(surface, IcpSetting(setting.reach_m, "plane"))
        self._surface = cKDTree(surface.points)
        sides = [_side(surface, way, seed) for seed, way in enumerate(_around(_DIRECTIONS))]
        self._points = np.concatenate([side.points for side in sides])
        self._features = cKDTree(
            np.concatenate([histograms(side.points, side.normals, setting.radius_m) for side in sides])
        )

    def find(self, cloud: Cloud, start: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """object_to_world, or None. It ignores the guess."""
        if len(cloud.points) < LEAST:
            return None
        random = np.random.default_rng(0)
        wanted = histograms(cloud.points, cloud.normals, self._setting.radius_m)
        _, alike = self._features.query(wanted, _CANDIDATES)
        drawn = random.integers(len(cloud.points), size=(_DRAWS, 3))
        seen = cloud.points[drawn]
        known = self._points[alike[drawn, random.integers(_CANDIDATES, size=drawn.shape)]]
        kept = _is_alike(seen, known)
        seen, known = seen[kept][:_TRIED], known[kept][:_TRIED]
        if not len(seen):
            return None
        poses = best_motion(known, seen)
        some = cloud.points[:_CHECKED]
        inside = (some[None] - poses[:, None, :3, 3]) @ poses[:, :3, :3]
        distance, _ = self._surface.query(inside, distance_upper_bound=self._setting.reach_m)
        agreeing = np.isfinite(distance).sum(axis=1)
        return self._icp.refine(cloud, poses[int(agreeing.argmax())])[0]


def _is_alike(seen: NDArray[np.float64], known: NDArray[np.float64]) -> NDArray[np.bool_]:
    """[n]: whether two triangles [n, 3, 3] have equal side lengths, none too short."""
    a, b = (np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2) for t in (seen, known))
    return np.asarray(((a > _SHORTEST_M) & (np.abs(a - b) < _STRETCH * a)).all(axis=1))


def _around(count: int) -> NDArray[np.float64]:
    """[count, 3] directions, spread evenly (Fibonacci's spiral)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def _side(surface: Surface, way: NDArray[np.float64], seed: int) -> Cloud:
    """The points visible from far in direction `way`: the front points of each cell of a grid across it."""
    facing = surface.normals @ way > 0.1
    points, normals = surface.points[facing], surface.normals[facing]
    first = np.cross(way, [0.0, 0.0, 1.0] if abs(way[2]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    across = points @ np.stack([first, np.cross(way, first)], axis=1)
    _, cell = np.unique(np.floor(across / _CELL_M).astype(int), axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    height = points @ way
    top = np.full(cell.max() + 1, -np.inf)
    np.maximum.at(top, cell, height)
    seen = np.flatnonzero(height > top[cell] - _BEHIND_M)
    seen = np.random.default_rng(seed).permutation(seen)[:_TEMPLATE_POINTS]
    return Cloud(points[seen], normals[seen])
