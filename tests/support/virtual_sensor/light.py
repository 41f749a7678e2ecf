# SPDX-License-Identifier: Apache-2.0
"""Radiance in a world of Lambertian solids: projector and uniform sky, paths of any number of bounces."""

import numpy as np

_LIFT = 1e-7


def closest(solids, origins, directions):
    """(t, unit normal facing the ray, albedo, index of the solid or -1) of the nearest hit of each ray."""
    t = np.full(len(origins), np.inf)
    normal = np.zeros_like(origins)
    albedo = np.zeros(len(origins))
    index = np.full(len(origins), -1)
    for i, solid in enumerate(solids):
        distance, n = solid.intersect(origins, directions)
        nearer = distance < t
        t = np.where(nearer, distance, t)
        normal[nearer] = n[nearer]
        albedo[nearer] = solid.albedo
        index[nearer] = i
    facing = np.einsum("ij,ij->i", normal, directions) > 0
    normal[facing] *= -1.0
    return t, normal, albedo, index


def projector_irradiance(solids, points, normals, projector):
    """Irradiance of unoccluded pattern light: I cos / d^2, bilinear in the pattern, zero outside it."""
    from_source = points - projector.position
    distance = np.linalg.norm(from_source, axis=1)
    direction = from_source / distance[:, None]
    local = (points @ projector.rotation) - projector.position @ projector.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        u = projector.K[0, 0] * local[:, 0] / local[:, 2] + projector.K[0, 2]
        v = projector.K[1, 1] * local[:, 1] / local[:, 2] + projector.K[1, 2]
    intensity = np.where(local[:, 2] > 0, bilinear(projector.pattern, u, v), 0.0)
    cosine = -np.einsum("ij,ij->i", normals, direction)
    lit = (intensity > 0) & (cosine > 0)
    irradiance = np.zeros(len(points))
    origin = np.broadcast_to(projector.position, (lit.sum(), 3))
    seen = closest(solids, origin, direction[lit])[0] > distance[lit] - 1e-6
    irradiance[lit] = (intensity * cosine / distance**2)[lit] * seen
    return irradiance


def bilinear(image, u, v):
    """Value at (u, v), pixel centres at integers; samples outside the image count as zero."""
    height, width = image.shape
    inside = (u > -1) & (v > -1) & (u < width) & (v < height)
    u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    padded = np.pad(image, 1)
    i, j = np.floor(u).astype(int), np.floor(v).astype(int)
    a, b = u - i, v - j
    i, j = i + 1, j + 1
    value = (padded[j, i] * (1 - a) + padded[j, i + 1] * a) * (1 - b)
    value += (padded[j + 1, i] * (1 - a) + padded[j + 1, i + 1] * a) * b
    return np.where(inside, value, 0.0)


def radiance(solids, origins, directions, projector, rng, bounces):
    """(direct projector, indirect projector, sky) radiance along each ray, sky radiance 1; and t, normal, index of the
    first hit. One cosine-distributed path per ray."""
    count = len(origins)
    direct, indirect, sky = np.zeros(count), np.zeros(count), np.zeros(count)
    weight = np.ones(count)
    first = None
    alive = np.arange(count)
    for depth in range(bounces + 2):
        t, normal, albedo, index = closest(solids, origins, directions)
        if depth == 0:
            first = t.copy(), normal.copy(), index.copy()
        hit = index >= 0
        sky[alive[~hit]] += weight[~hit]
        if depth == bounces + 1:
            break  # this last ray only asks whether the sky is seen
        alive, weight, normal, albedo = alive[hit], weight[hit] * albedo[hit], normal[hit], albedo[hit]
        points = origins[hit] + t[hit, None] * directions[hit] + _LIFT * normal
        light = weight / np.pi * projector_irradiance(solids, points, normal, projector)
        (direct if depth == 0 else indirect)[alive] += light
        origins, directions = points, _cosine_direction(normal, rng.uniform()[alive], rng.uniform()[alive])
    return direct, indirect, sky, first


def _cosine_direction(normal, a, b):
    """A unit sphere's surface point added to the normal is cosine-distributed."""
    z = 2.0 * a - 1.0
    r = np.sqrt(np.maximum(0.0, 1.0 - z * z))
    sphere = np.stack([r * np.cos(2 * np.pi * b), r * np.sin(2 * np.pi * b), z], axis=1)
    direction = normal + (1.0 - 1e-9) * sphere
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)
