# SPDX-License-Identifier: Apache-2.0
"""Concave polygons as triangles: ears are cut off one after another (Meisters, Polygons have ears, 1975)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

_MOST_CORNERS = 2000  # its cost grows by the square; beyond, a polygon stays a fan


def concave_faces(places: Points, face: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces that are not convex. places [corners, 3], face [corners]: the face of each, count [faces]: corners."""
    first = np.cumsum(count) - count
    step = np.arange(len(face)) - first[face]
    after, before = (first[face] + (step + turn) % count[face] for turn in (1, -1))
    normal = np.zeros((len(count), 3))
    np.add.at(normal, face, np.cross(places - places[first[face]], places[after] - places[first[face]]))
    turn = np.cross(places - places[before], places[after] - places)
    size = np.linalg.norm(turn, axis=1) * np.linalg.norm(normal[face], axis=1)
    inward = np.einsum("ij,ij->i", turn, normal[face]) < -1e-6 * size
    return np.asarray(np.unique(face[inward & (count[face] > 3) & (count[face] <= _MOST_CORNERS)]))


def ears(places: Points) -> NDArray[np.int64]:
    """[n - 2, 3] corners of the triangles of a polygon [n, 3], in its own direction."""
    normal = np.cross(places - places[0], np.roll(places, -1, axis=0) - places[0]).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    flat = places[:, [(axis + 1) % 3, (axis + 2) % 3]]
    if normal[axis] < 0:
        flat = flat[:, ::-1]
    rest, out = list(range(len(flat))), []
    while len(rest) > 3:
        ear = next((k for k in range(len(rest)) if _is_ear(flat, rest, k)), 0)  # 0: its sides cross each other
        out.append([rest[ear - 1], rest[ear], rest[(ear + 1) % len(rest)]])
        del rest[ear]
    return np.array([*out, rest])


def _is_ear(flat: Points, rest: list[int], k: int) -> bool:
    triangle = [rest[k - 1], rest[k], rest[(k + 1) % len(rest)]]
    a, b, c = flat[triangle]
    if _turn(a, b, c) <= 0:
        return False
    others = flat[[i for i in rest if i not in triangle]]
    inside = np.all([_turn(p, q, others) >= 0 for p, q in ((a, b), (b, c), (c, a))], axis=0)
    corner = np.any([(others == p).all(axis=1) for p in (a, b, c)], axis=0)  # a hole's bridge comes back to it
    return not bool((inside & ~corner).any())


def _turn(a: Points, b: Points, c: Points) -> Points:
    """Twice the area of the triangles, positive where they turn left."""
    return np.asarray((b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0]))
