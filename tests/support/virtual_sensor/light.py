# SPDX-License-Identifier: Apache-2.0
"""Computes radiance of Lambertian solids under a projector and a uniform sky, over any number of bounces."""

import numpy as np
from scipy.ndimage import map_coordinates

from virtual_sensor.held_out.caster import albedo_of, closest

_LIFT = 1e-7


def projector_irradiance(solids, points, normals, projector):
    """Returns irradiance [2][n], I cos / d^2: of the bilinear pattern, 0 outside, and of one that is 1 everywhere."""
    from_source = points - projector.position
    distance = np.linalg.norm(from_source, axis=1)
    direction = from_source / distance[:, None]
    local = (points @ projector.rotation) - projector.position @ projector.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        u = projector.K[0, 0] * local[:, 0] / local[:, 2] + projector.K[0, 2]
        v = projector.K[1, 1] * local[:, 1] / local[:, 2] + projector.K[1, 2]
    cosine = -np.einsum("ij,ij->i", normals, direction)
    lit = np.flatnonzero((local[:, 2] > 0) & (cosine > 0) & _inside(projector.pattern, u, v))
    origin = np.broadcast_to(projector.position, (len(lit), 3))
    lit = lit[closest(solids, origin, direction[lit])[0] > distance[lit] - 1e-6]
    irradiance = np.zeros((2, len(points)))
    irradiance[:, lit] = cosine[lit] / distance[lit] ** 2 * bilinear(projector.pattern, u[lit], v[lit])
    return irradiance


def _inside(image, u, v):
    """Returns a mask of places (u, v) at which a bilinear look-up meets a pixel of the image."""
    height, width = image.shape
    return (u > -1) & (v > -1) & (u < width) & (v < height)


def bilinear(image, u, v):
    """Interpolates the image, and one of ones, at places (u, v). Returns [2][n]; samples outside are zero."""
    both = image, np.ones_like(image)
    return np.stack([map_coordinates(one, (v, u), order=1, mode="grid-constant") for one in both])


def radiance(solids, origins, directions, projector, numbers, bounces):
    """Traces one cosine-distributed path per ray under a sky of radiance 1, by numbers in 0..1 [bounces + 1][2][n].
    Returns radiances [4][n] (direct projector, indirect projector, sky, direct projector with a pattern of 1), and
    (t, normal, index) of the first hit."""
    count = len(origins)
    direct, indirect, sky, flat = lights = np.zeros((4, count))
    weight = np.ones(count)
    first = None
    alive = np.arange(count)
    for depth in range(bounces + 2):
        t, normal, index = closest(solids, origins, directions)
        if depth == 0:
            first = t.copy(), normal.copy(), index.copy()
        hit = index >= 0
        sky[alive[~hit]] += weight[~hit]
        if depth == bounces + 1:
            break  # the last ray only tests whether it reaches the sky
        alive, normal = alive[hit], normal[hit]
        points = origins[hit] + t[hit, None] * directions[hit] + _LIFT * normal
        weight = weight[hit] * albedo_of(solids, index[hit], points)
        light, under_ones = weight / np.pi * projector_irradiance(solids, points, normal, projector)
        (direct if depth == 0 else indirect)[alive] += light
        if depth == 0:
            flat[alive] = under_ones
        origins, directions = points, _cosine_direction(normal, *numbers[depth][:, alive])
    return lights, first


def _cosine_direction(normal, a, b):
    """Returns cosine-distributed unit directions [n][3], by random numbers a, b in 0..1."""
    z = 2.0 * a - 1.0
    r = np.sqrt(np.maximum(0.0, 1.0 - z * z))
    sphere = np.stack([r * np.cos(2 * np.pi * b), r * np.sin(2 * np.pi * b), z], axis=1)
    direction = normal + (1.0 - 1e-9) * sphere
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)
