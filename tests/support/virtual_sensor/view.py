# SPDX-License-Identifier: Apache-2.0
"""Renders a world's image: jittered subpixel rays, on a lattice shifted at random (Cranley and Patterson 1976)."""

from dataclasses import dataclass

import numpy as np

from virtual_sensor.held_out.caster import closest
from virtual_sensor.light import radiance
from virtual_sensor.pcg import Pcg


@dataclass(frozen=True)
class PatternSource:
    """A projector in world coordinates. rotation: its axes as columns; pattern: relative intensity 0..1."""

    position: np.ndarray
    rotation: np.ndarray
    K: np.ndarray
    pattern: np.ndarray


@dataclass(frozen=True)
class View:
    """A camera's noise-free images [height][width]: radiance by source, and geometry. flat: the direct projector light
    if the pattern were 1; depth, normal (world), index of the solid: at the pixel centres."""

    direct: np.ndarray
    indirect: np.ndarray
    sky: np.ndarray
    flat: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    index: np.ndarray


def look(solids, size, K, camera_to_world, projector, seed, grid=4, bounces=4):
    """Renders a camera's View. size: (width, height); grid: jittered rays per pixel along each side."""
    width, height = size
    rng = Pcg(width * height, seed)
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    shifts = np.stack([rng.uniform() for _ in range(2 * (bounces + 1))])
    steps = lattice_steps(len(shifts))[:, None]
    sums = np.zeros((4, width * height))
    for j in range(grid):
        for i in range(grid):
            u = columns.ravel() - 0.5 + (i + rng.uniform()) / grid
            v = rows.ravel() - 0.5 + (j + rng.uniform()) / grid
            origins, directions, _ = _rays(u, v, K, camera_to_world)
            numbers = (shifts + (j * grid + i) * steps) % 1.0
            sums += radiance(solids, origins, directions, projector, numbers.reshape(bounces + 1, 2, -1), bounces)[0]
    lights = (sums / grid**2).reshape(4, height, width)
    origins, directions, cosine = _rays(columns.ravel(), rows.ravel(), K, camera_to_world)
    t, normal, index = closest(solids, origins, directions)
    depth = np.where(np.isfinite(t), t * cosine, 0.0)
    return View(*lights, depth.reshape(height, width), normal.reshape(height, width, 3), index.reshape(height, width))


def lattice_steps(dimensions):
    """Returns a low-discrepancy lattice's steps: powers of 1 / g with g^(dimensions + 1) = g + 1."""
    g = 2.0
    for _ in range(60):
        g = (1.0 + g) ** (1.0 / (dimensions + 1))
    return g ** -np.arange(1.0, dimensions + 1)


def _rays(u, v, K, camera_to_world):
    """Returns world origins and unit directions [n][3] through pixels (u, v), and their cosines to the axis."""
    local = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], axis=1)
    length = np.linalg.norm(local, axis=1)
    directions = (local / length[:, None]) @ camera_to_world[:3, :3].T
    return np.broadcast_to(camera_to_world[:3, 3], directions.shape), directions, 1.0 / length
