# SPDX-License-Identifier: Apache-2.0
"""Divides every surface of a solid into charts, grids of texels for light that varies smoothly over the surface."""

from dataclasses import dataclass

import numpy as np

from virtual_sensor.cylinder import Cylinder
from virtual_sensor.solids import Box, Rectangle, Sphere


@dataclass(frozen=True)
class Chart:
    """A grid of texels on one surface. points, normals: [rows][columns][3]; wraps: columns are periodic."""

    points: np.ndarray
    normals: np.ndarray
    wraps: bool = False


def charts(solid, spacing):
    """Returns the charts of a solid, with texels about `spacing` metres apart."""
    if isinstance(solid, Rectangle):
        return [_rectangle(np.asarray(solid.centre), np.asarray(solid.u), np.asarray(solid.v), spacing)]
    if isinstance(solid, Box):
        return _box(solid, spacing)
    if isinstance(solid, Sphere):
        return [_sphere(solid, spacing)]
    return _cylinder(solid, spacing)


def locate(solid, points, shapes):
    """Returns (chart, row, column) of surface points, whole at texel centres. shapes: (rows, columns) of each chart."""
    if isinstance(solid, Rectangle):
        chart = np.zeros(len(points), dtype=int)
        offset = points - np.asarray(solid.centre)
        s, t = (offset @ np.asarray(e) / np.dot(e, e) for e in (solid.u, solid.v))
    elif isinstance(solid, Box):
        chart, s, t = _on_box(solid, points)
    elif isinstance(solid, Sphere):
        chart = np.zeros(len(points), dtype=int)
        local = (points - np.asarray(solid.centre)) / solid.radius
        s = 2 * np.arccos(np.clip(local[:, 1], -1, 1)) / np.pi - 1
        t = np.arctan2(local[:, 2], local[:, 0]) / np.pi
    else:
        chart, s, t = _on_cylinder(solid, points)
    size = np.asarray(shapes)[chart]
    return chart, (s + 1) / 2 * size[:, 0] - 0.5, (t + 1) / 2 * size[:, 1] - 0.5


def inside(solid, points):
    """Returns whether each point lies inside a solid, or behind a rectangle."""
    offset = points - np.asarray(solid.centre)
    if isinstance(solid, Rectangle):
        return offset @ np.cross(solid.u, solid.v) < 0
    if isinstance(solid, Box):
        return (np.abs(offset @ solid.rotation()) <= solid.half_size).all(axis=-1)
    if isinstance(solid, Sphere):
        return (offset**2).sum(axis=-1) <= solid.radius**2
    local = offset @ solid.frame().T
    return (np.hypot(local[..., 0], local[..., 1]) <= solid.radius) & (np.abs(local[..., 2]) <= solid.half_length)


def bounding_radius(solid):
    """Returns a bounding sphere's radius about the solid's centre; None for rectangles, tested with every ray."""
    if isinstance(solid, Rectangle):
        return None
    if isinstance(solid, Box):
        return float(np.linalg.norm(solid.half_size))
    return float(np.hypot(solid.radius, solid.half_length)) if isinstance(solid, Cylinder) else solid.radius


def _centres(count):
    return (np.arange(count) + 0.5) / count * 2 - 1


def _counts(length_a, length_b, spacing):
    return max(2, round(length_a / spacing)), max(2, round(length_b / spacing))


def _rectangle(centre, u, v, spacing):
    rows, columns = _counts(2 * np.linalg.norm(u), 2 * np.linalg.norm(v), spacing)
    points = centre + _centres(rows)[:, None, None] * u + _centres(columns)[None, :, None] * v
    normal = np.cross(u, v)
    return Chart(points, np.broadcast_to(normal / np.linalg.norm(normal), points.shape))


def _box(box, spacing):
    """Returns the charts of a box's faces in the order -x, +x, -y, +y, -z, +z."""
    rotation, faces = box.rotation(), []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            rows, columns = _counts(2 * box.half_size[a], 2 * box.half_size[b], spacing)
            local = np.zeros((rows, columns, 3))
            local[..., axis] = sign * box.half_size[axis]
            local[..., a] = _centres(rows)[:, None] * box.half_size[a]
            local[..., b] = _centres(columns)[None] * box.half_size[b]
            normal = np.broadcast_to(sign * rotation[:, axis], local.shape)
            faces.append(Chart(local @ rotation.T + box.centre, normal))
    return faces


def _on_box(box, points):
    relative = (points - np.asarray(box.centre)) @ box.rotation() / np.asarray(box.half_size)
    axis = np.abs(relative).argmax(axis=1)
    rows = np.arange(len(points))
    chart = 2 * axis + (relative[rows, axis] > 0)
    return chart, relative[rows, (axis + 1) % 3], relative[rows, (axis + 2) % 3]


def _sphere(sphere, spacing):
    rows, columns = _counts(np.pi * sphere.radius, 2 * np.pi * sphere.radius, spacing)
    polar, turn = (_centres(rows)[:, None] + 1) / 2 * np.pi, _centres(columns)[None] * np.pi
    normals = np.stack([np.sin(polar) * np.cos(turn), np.cos(polar) + 0 * turn, np.sin(polar) * np.sin(turn)], axis=-1)
    return Chart(np.asarray(sphere.centre) + sphere.radius * normals, normals, wraps=True)


def _cylinder(cylinder, spacing):
    """Returns a cylinder's charts: the side, then the caps at the axis' two ends, as squares around the discs."""
    frame = cylinder.frame()
    rows, columns = _counts(2 * cylinder.half_length, 2 * np.pi * cylinder.radius, spacing)
    turn = _centres(columns)[None] * np.pi
    across = np.stack(np.broadcast_arrays(np.cos(turn), np.sin(turn), 0 * turn), axis=-1) + np.zeros((rows, 1, 1))
    along = np.zeros_like(across)
    along[..., 2] = _centres(rows)[:, None] * cylinder.half_length
    found = [Chart((cylinder.radius * across + along) @ frame + cylinder.centre, across @ frame, wraps=True)]
    for sign in (-1.0, 1.0):
        cap = _rectangle(
            np.asarray(cylinder.centre) + sign * cylinder.half_length * frame[2],
            cylinder.radius * frame[0], cylinder.radius * frame[1], spacing,
        )  # fmt: skip
        found.append(Chart(cap.points, np.broadcast_to(sign * frame[2], cap.points.shape)))
    return found


def _on_cylinder(cylinder, points):
    local = (points - np.asarray(cylinder.centre)) @ cylinder.frame().T
    cap = np.abs(local[:, 2]) >= cylinder.half_length * (1 - 1e-9)
    cap &= np.hypot(local[:, 0], local[:, 1]) < cylinder.radius * (1 - 1e-9)
    chart = np.where(cap, np.where(local[:, 2] > 0, 2, 1), 0)
    s = np.where(cap, local[:, 0] / cylinder.radius, local[:, 2] / cylinder.half_length)
    t = np.where(cap, local[:, 1] / cylinder.radius, np.arctan2(local[:, 1], local[:, 0]) / np.pi)
    return chart, s, t
