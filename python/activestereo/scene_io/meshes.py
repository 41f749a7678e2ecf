# SPDX-License-Identifier: Apache-2.0
"""Makes triangle meshes from a few numbers: boxes, spheres, tori, sheets and lathed profiles. Units are metres; y is
up; triangles are counter-clockwise from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Mesh:
    positions: np.ndarray  # float32 [n, 3]
    normals: np.ndarray  # float32 [n, 3], unit
    uvs: np.ndarray  # float32 [n, 2], v down
    indices: np.ndarray  # uint32 [t, 3]

    @classmethod
    def from_arrays(cls, positions: ArrayLike, normals: ArrayLike, uvs: ArrayLike, indices: ArrayLike) -> Mesh:
        points, directions, places = (np.ascontiguousarray(a, dtype=np.float32) for a in (positions, normals, uvs))
        return cls(points, directions, places, np.ascontiguousarray(indices, dtype=np.uint32))


def joined(parts: Sequence[Mesh]) -> Mesh:
    offsets = np.cumsum([0] + [len(p.positions) for p in parts[:-1]])
    return Mesh.from_arrays(
        np.vstack([p.positions for p in parts]),
        np.vstack([p.normals for p in parts]),
        np.vstack([p.uvs for p in parts]),
        np.vstack([p.indices + offset for p, offset in zip(parts, offsets, strict=True)]),
    )


def grid(rows: int, columns: int) -> np.ndarray:
    """Returns triangles [t, 3] of a rows x columns grid of vertices, counter-clockwise when columns go right and rows
    go up."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = first, first + 1, first + columns, first + columns + 1
    return np.vstack([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])


def depth_triangles(depth: np.ndarray, largest_step: float, wanted: np.ndarray | None = None) -> np.ndarray:
    """Connects neighbouring pixels of a depth image [height, width] (0 = none) to triangles [t, 3] of pixel numbers.
    The depths of a triangle differ by less than `largest_step` times its least depth. wanted: mask of pixels; each
    triangle has at least one."""
    number = np.arange(depth.size).reshape(depth.shape)
    a, b, c, d = np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, :-1], np.s_[1:, 1:]
    faces = []
    for corners in ((a, c, b), (b, c, d)):
        each = np.stack([depth[k] for k in corners])
        whole = (each > 0).all(axis=0) & (np.ptp(each, axis=0) < largest_step * each.min(axis=0))
        if wanted is not None:
            whole &= np.any([wanted[k] for k in corners], axis=0)
        faces.append(np.stack([number[k][whole] for k in corners], axis=-1))
    return np.concatenate(faces)


def sheet(origin: ArrayLike, side_u: ArrayLike, side_v: ArrayLike) -> Mesh:
    """Makes a parallelogram from a corner and two sides. Its front faces along cross(side_u, side_v); the texture is
    upright with side_v up."""
    origin, side_u, side_v = (np.asarray(v, dtype=np.float64) for v in (origin, side_u, side_v))
    normal = np.cross(side_u, side_v)
    normal /= np.linalg.norm(normal)
    corners = [origin, origin + side_u, origin + side_v, origin + side_u + side_v]
    return Mesh.from_arrays(corners, [normal] * 4, [[0, 1], [1, 1], [0, 0], [1, 0]], grid(2, 2))


def box(width: float, height: float, depth: float) -> Mesh:
    """Makes a box with sides along x, y, z. It stands on y = 0, centred in x and z."""
    faces = []
    half = 0.5 * np.array([width, height, depth])
    for axis in range(3):
        for sign in (1.0, -1.0):
            n, u = np.zeros(3), np.zeros(3)
            n[axis] = sign
            u[(axis + 1) % 3] = 1.0
            v = np.cross(n, u)
            faces.append(sheet((n - u - v) * half + [0, half[1], 0], 2 * u * half, 2 * v * half))
    return joined(faces)


def lathe(profiles: Sequence[ArrayLike], segments: int = 96) -> Mesh:
    """Makes a surface by turning profiles about the y axis. Each profile is a smooth line of (radius, height) points,
    with the outside to its right. Between two profiles there is a crease."""
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    around = np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], axis=1)
    up, parts = np.array([0.0, 1.0, 0.0]), []
    for profile in (np.asarray(p, dtype=np.float64) for p in profiles):
        tangent = np.gradient(profile, axis=0)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        points = (profile[:, :1, None] * around + profile[:, 1:, None] * up).reshape(-1, 3)
        normals = tangent[:, 1:, None] * around - tangent[:, :1, None] * up
        length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))]
        v, u = np.meshgrid(1.0 - length / length[-1], angle / (2.0 * np.pi), indexing="ij")
        triangles = grid(len(profile), segments + 1)
        a, b, c = (points[triangles[:, k]] for k in range(3))
        triangles = triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-14]
        parts.append(
            Mesh.from_arrays(points, normals.reshape(-1, 3), np.stack([u.ravel(), v.ravel()], axis=1), triangles)
        )
    return joined(parts)


def arc(centre: tuple[float, float], radius: float, start_deg: float, end_deg: float, points: int = 24) -> np.ndarray:
    """Returns points [n, 2] (radius, height) on a circle's arc, as a profile for lathe(). 0 degrees points outwards, 90
    up."""
    angle = np.deg2rad(np.linspace(start_deg, end_deg, points))
    return np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], axis=1)


def sphere(radius: float) -> Mesh:
    """Makes a sphere centred at the origin."""
    profile = arc((0.0, 0.0), radius, -90.0, 90.0, 49)
    profile[[0, -1], 0] = 0.0
    return lathe([profile])


def torus(ring_radius: float, tube_radius: float) -> Mesh:
    """Makes a torus about the y axis that lies on y = 0."""
    return lathe([arc((ring_radius, tube_radius), tube_radius, -180.0, 180.0, 49)])


def tumbler(radius: float, height: float, wall: float, base: float) -> Mesh:
    """Makes a straight drinking glass as a closed surface: outer wall, round rim, inner wall, thick base. It stands on
    y = 0."""
    rim = arc((radius - 0.5 * wall, height - 0.5 * wall), 0.5 * wall, 0.0, 180.0, 13)
    foot = arc((radius - 0.004, 0.004), 0.004, -90.0, 0.0, 9)
    inside = arc((radius - wall - 0.006, base + 0.006), 0.006, 0.0, -90.0, 9)
    under, floor = [(0.0, 0.0), (radius - 0.004, 0.0)], [(radius - wall - 0.006, base), (0.0, base)]
    return lathe([under, np.vstack([foot, rim, inside]), floor], segments=128)


def vase(height: float) -> Mesh:
    """Makes a bellied vase, open at the top, that stands on y = 0."""
    t = np.linspace(0.0, 1.0, 65)
    radius = height * (
        0.17 + 0.16 * np.sin(np.pi * (t * 0.92 + 0.06)) ** 2 - 0.06 * t + 0.05 * np.maximum(t - 0.85, 0.0) / 0.15
    )
    outside = np.stack([radius, t * height], axis=1)
    inside = (outside - [0.005, 0.0])[::-1]
    inside = inside[inside[:, 1] > 0.006]
    return lathe(
        [[(0.0, 0.0), outside[0]], outside, [outside[-1], inside[0]], inside, [inside[-1], (0.0, inside[-1, 1])]]
    )
