# SPDX-License-Identifier: Apache-2.0
"""Defines upright or lying cylinders with caps: closed-form intersection, and triangles for the glTF file."""

from dataclasses import dataclass

import numpy as np

_EPSILON = 1e-9
_SEGMENTS = 192


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder with caps, from `centre` by half_length to both sides along the unit vector `axis`."""

    name: str
    centre: tuple
    axis: tuple
    radius: float
    half_length: float
    albedo: float

    def frame(self):
        """Returns a rotation matrix whose rows are two unit vectors across the axis, then the axis."""
        axis = np.asarray(self.axis, dtype=np.float64)
        helper = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) < 0.7 else np.array([1.0, 0.0, 0.0])
        across = np.cross(helper, axis)
        across /= np.linalg.norm(across)
        return np.stack([across, np.cross(axis, across), axis])

    def intersect(self, origins, directions):
        frame = self.frame()
        o = (origins - np.asarray(self.centre)) @ frame.T
        d = directions @ frame.T
        t_side, side_hit = self._side(o, d)
        t_cap, cap_sign = self._caps(o, d)
        t = np.minimum(t_side, t_cap)
        normal = np.zeros_like(o)
        on_side = side_hit & (t_side <= t_cap)
        point = o[on_side] + t[on_side, None] * d[on_side]
        normal[on_side, :2] = point[:, :2] / self.radius
        normal[~on_side, 2] = cap_sign[~on_side]
        return t, normal @ frame

    def _side(self, o, d):
        a = d[:, 0] ** 2 + d[:, 1] ** 2
        b = o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1]
        c = o[:, 0] ** 2 + o[:, 1] ** 2 - self.radius**2
        discriminant = b * b - a * c
        root = np.sqrt(np.maximum(discriminant, 0.0))
        best = np.full(len(o), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            for t in ((-b + root) / a, (-b - root) / a):
                inside = (discriminant >= 0) & (t > _EPSILON) & (np.abs(o[:, 2] + t * d[:, 2]) <= self.half_length)
                best = np.where(inside & (t < best), t, best)
        return best, np.isfinite(best)

    def _caps(self, o, d):
        best, sign = np.full(len(o), np.inf), np.ones(len(o))
        for s in (-1.0, 1.0):
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (s * self.half_length - o[:, 2]) / d[:, 2]
                across = (o[:, :2] + t[:, None] * d[:, :2]) ** 2
                inside = (t > _EPSILON) & (across.sum(axis=1) <= self.radius**2) & (t < best)
            best, sign = np.where(inside, t, best), np.where(inside, s, sign)
        return best, sign

    def triangles(self):
        turn = np.linspace(0, 2 * np.pi, _SEGMENTS + 1)
        circle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        up = np.array([0.0, 0.0, self.half_length])
        positions = [self.radius * circle - up, self.radius * circle + up]
        normals = [circle, circle]
        a = np.arange(_SEGMENTS)
        b = a + _SEGMENTS + 1
        faces = [np.stack([a, a + 1, b + 1], -1), np.stack([a, b + 1, b], -1)]
        for s in (-1.0, 1.0):
            start = sum(map(len, positions))
            positions.append(np.concatenate([[s * up], self.radius * circle + s * up]))
            normals.append(np.broadcast_to([0.0, 0.0, s], positions[-1].shape))
            rim = start + 1 + a
            first, second = (rim, rim + 1) if s > 0 else (rim + 1, rim)
            faces.append(np.stack([np.full(_SEGMENTS, start), first, second], -1))
        frame = self.frame()
        return np.concatenate(positions) @ frame + self.centre, np.concatenate(normals) @ frame, np.concatenate(faces)
