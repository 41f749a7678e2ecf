# SPDX-License-Identifier: Apache-2.0
"""Finds nearest hits and occlusion of rays; bounding spheres first exclude most rays."""

import numpy as np

from virtual_sensor.held_out.charts import bounding_radius

LIFT_M = 1e-6


def closest(solids, origins, directions, skip=None):
    """Returns (t, unit normal facing the ray, solid's index or -1) of the nearest hits. skip: solids to pass."""
    t = np.full(len(directions), np.inf)
    normal = np.zeros((len(directions), 3))
    index = np.full(len(directions), -1)
    for i, solid in enumerate(solids):
        rays = _candidates(solid, origins, directions)
        if skip is not None:
            rays = rays[skip[rays] != i]
        if not rays.size:
            continue
        distance, n = solid.intersect(origins[rays], directions[rays])
        nearer = distance < t[rays]
        chosen = rays[nearer]
        t[chosen], normal[chosen], index[chosen] = distance[nearer], n[nearer], i
    facing = np.einsum("ij,ij->i", normal, directions) > 0
    normal[facing] *= -1.0
    return t, normal, index


def transmittance(solids, origins, targets, through=None):
    """Returns the share of light that passes from origins to targets [n][3], 0 behind a solid; rectangles bound the
    room and cast no shadow into it. through: {index of a solid: the share that it transmits}."""
    way = targets - origins
    distance = np.linalg.norm(way, axis=1)
    directions = way / distance[:, None]
    share = np.ones(len(targets))
    for i, solid in enumerate(solids):
        if bounding_radius(solid) is None:
            continue
        rays = _candidates(solid, origins, directions)
        if rays.size:
            hit = solid.intersect(origins[rays], directions[rays])[0] < distance[rays] - LIFT_M
            share[rays[hit]] *= (through or {}).get(i, 0.0)
    return share


def albedo_of(solids, index, points):
    """Returns the diffuse albedo at each hit point, 0 without a hit. index: the solid hit, or -1."""
    albedo = np.zeros(len(points))
    for i, solid in enumerate(solids):
        here = index == i
        if here.any():
            albedo[here] = solid.albedo_at(points[here]) if hasattr(solid, "albedo_at") else solid.albedo
    return albedo


def _candidates(solid, origins, directions):
    """Returns the indices of the rays that meet the solid's bounding sphere ahead of them."""
    radius = bounding_radius(solid)
    if radius is None:
        return np.arange(len(directions))
    to_centre = np.asarray(solid.centre) - origins
    along = np.einsum("ij,ij->i", to_centre, directions)
    across = np.einsum("ij,ij->i", to_centre, to_centre) - along**2
    return np.flatnonzero((across <= radius**2) & (along > -radius))


def tangents(normals):
    """Returns two unit vectors for each normal [n][3], across it and across one another."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    tangent = np.cross(helper, normals)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return tangent, np.cross(normals, tangent)
