# SPDX-License-Identifier: Apache-2.0
"""The image of one pinhole camera of a world: every pixel is the mean over a grid of jittered subpixel rays."""

from dataclasses import dataclass

import numpy as np

from virtual_sensor.light import radiance
from virtual_sensor.pcg import Pcg


@dataclass(frozen=True)
class PatternSource:
    """A projector in world coordinates: rotation columns are its axes."""

    position: np.ndarray
    rotation: np.ndarray
    K: np.ndarray
    pattern: np.ndarray


@dataclass(frozen=True)
class View:
    """Images [height][width] of the three lights, and depth, normal (world) and solid index at the pixel centres."""

    direct: np.ndarray
    indirect: np.ndarray
    sky: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    index: np.ndarray


def look(solids, size, K, camera_to_world, projector, seed, grid=4, bounces=4):
    """A View of width x height = size; grid x grid rays per pixel, each jittered within its cell."""
    width, height = size
    rng = Pcg(width * height, seed)
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    sums = np.zeros((3, width * height))
    for j in range(grid):
        for i in range(grid):
            u = columns.ravel() - 0.5 + (i + rng.uniform()) / grid
            v = rows.ravel() - 0.5 + (j + rng.uniform()) / grid
            origins, directions, _ = _rays(u, v, K, camera_to_world)
            sums += radiance(solids, origins, directions, projector, rng, bounces)[:3]
    direct, indirect, sky = (sums / grid**2).reshape(3, height, width)
    origins, directions, cosine = _rays(columns.ravel(), rows.ravel(), K, camera_to_world)
    t, normal, index = radiance(solids, origins, directions, projector, rng, 0)[3]
    depth = np.where(np.isfinite(t), t * cosine, 0.0)
    return View(direct, indirect, sky, depth.reshape(height, width), normal.reshape(height, width, 3),
                index.reshape(height, width))  # fmt: skip


def _rays(u, v, K, camera_to_world):
    """World origins and unit directions through pixels (u, v), and the cosine to the optical axis."""
    local = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], axis=1)
    length = np.linalg.norm(local, axis=1)
    directions = (local / length[:, None]) @ camera_to_world[:3, :3].T
    return np.broadcast_to(camera_to_world[:3, 3], directions.shape), directions, 1.0 / length
