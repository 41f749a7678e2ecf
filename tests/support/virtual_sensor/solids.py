# SPDX-License-Identifier: Apache-2.0
"""Defines Lambertian solids, closed or two-sided, with closed-form ray intersections and triangles for the glTF file.
Rays are float64 arrays of origins and unit directions [n][3]; a miss has t = inf. Normals point outwards."""

from dataclasses import dataclass

import numpy as np

_EPSILON = 1e-9


def _unit(v):
    v = np.asarray(v, dtype=np.float64)
    return v / np.linalg.norm(v)


@dataclass(frozen=True)
class Rectangle:
    """A rectangle with its centre at `centre`. u, v: perpendicular half-edge vectors, metres; the normal is u x v."""

    name: str
    centre: tuple
    u: tuple
    v: tuple
    albedo: float

    def intersect(self, origins, directions):
        centre, u, v = (np.asarray(a, dtype=np.float64) for a in (self.centre, self.u, self.v))
        normal = _unit(np.cross(u, v))
        slope = directions @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((centre - origins) @ normal) / slope
        ahead = np.flatnonzero(np.isfinite(t) & (t > _EPSILON))
        offset = origins[ahead] + t[ahead, None] * directions[ahead] - centre
        inside = (np.abs(offset @ u) <= u @ u) & (np.abs(offset @ v) <= v @ v)
        out = np.full(len(t), np.inf)
        out[ahead[inside]] = t[ahead[inside]]
        return out, np.broadcast_to(normal, origins.shape)

    def triangles(self):
        centre, u, v = (np.asarray(a, dtype=np.float64) for a in (self.centre, self.u, self.v))
        corners = np.array([centre - u - v, centre + u - v, centre + u + v, centre - u + v])
        return corners, np.repeat(_unit(np.cross(u, v))[None], 4, axis=0), np.array([[0, 1, 2], [0, 2, 3]])


@dataclass(frozen=True)
class Sphere:
    name: str
    centre: tuple
    radius: float
    albedo: float

    def intersect(self, origins, directions):
        to_origin = origins - np.asarray(self.centre, dtype=np.float64)
        b = np.einsum("ij,ij->i", to_origin, directions)
        c = np.einsum("ij,ij->i", to_origin, to_origin) - self.radius**2
        discriminant = b * b - c
        root = np.sqrt(np.maximum(discriminant, 0.0))
        near, far = -b - root, -b + root
        t = np.where(near > _EPSILON, near, far)
        t = np.where((discriminant >= 0) & (t > _EPSILON), t, np.inf)
        points = to_origin + np.where(np.isfinite(t), t, 0.0)[:, None] * directions
        return t, points / self.radius

    def triangles(self, rows=96, columns=192):
        polar = np.linspace(0, np.pi, rows + 1)[:, None]
        turn = np.linspace(0, 2 * np.pi, columns + 1)[None]
        normals = np.stack(
            [np.sin(polar) * np.cos(turn), np.cos(polar) * np.ones_like(turn), -np.sin(polar) * np.sin(turn)], axis=-1
        ).reshape(-1, 3)
        a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)[None]).ravel()
        b = a + columns + 1
        faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)])
        return np.asarray(self.centre) + self.radius * normals, normals, faces


@dataclass(frozen=True)
class Box:
    """A box turned by `yaw` radians about the y axis."""

    name: str
    centre: tuple
    half_size: tuple
    yaw: float
    albedo: float

    def rotation(self):
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])

    def intersect(self, origins, directions):
        rotation, half = self.rotation(), np.asarray(self.half_size, dtype=np.float64)
        local_origin = (origins - np.asarray(self.centre)) @ rotation
        local_direction = directions @ rotation
        enter, leave = np.full(len(origins), -np.inf), np.full(len(origins), np.inf)
        axis = np.zeros(len(origins), np.intp)
        for k in range(3):  # looping over columns is far faster than reductions over rows of three
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1.0 / local_direction[:, k]
                low, high = (-half[k] - local_origin[:, k]) * inverse, (half[k] - local_origin[:, k]) * inverse
            near, far = np.minimum(low, high), np.maximum(low, high)  # NaN if a ray lies in a face's plane
            later = near > enter
            axis[later], enter = k, np.where(later, near, enter)
            leave = np.fmin(leave, far)
        t = np.where((enter <= leave) & (enter > _EPSILON), enter, np.inf)
        towards = np.take_along_axis(local_direction, axis[:, None], axis=1)
        return t, -np.sign(towards) * rotation.T[axis]

    def triangles(self):
        positions, normals, faces = [], [], []
        for axis in range(3):
            for sign in (-1.0, 1.0):
                n, u, v = np.zeros(3), np.zeros(3), np.zeros(3)
                n[axis], u[(axis + 1) % 3], v[(axis + 2) % 3] = sign, sign, 1.0
                quad = Rectangle("", n * self.half_size, u * self.half_size, v * self.half_size, 0.0).triangles()
                faces.append(quad[2] + 4 * len(faces))
                positions.append(quad[0])
                normals.append(quad[1])
        rotation = self.rotation()
        return (np.concatenate(positions) @ rotation.T + self.centre, np.concatenate(normals) @ rotation.T,
                np.concatenate(faces))  # fmt: skip
