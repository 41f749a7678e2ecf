# SPDX-License-Identifier: Apache-2.0
"""Adds a glossy coat to some of the solids: Beckmann facets under Schlick's Fresnel term (the product uses GGX)."""

import numpy as np

from virtual_sensor.held_out.caster import albedo_of, closest, transmittance

_LOBE = 4


def glints(world, frame, directions, points, normals, index, poses, row, ambient):
    """Returns for each ray: the projector's glint, the reflected sky and surroundings, and the share of diffuse light
    that is left. poses[row]: the left camera's pose at each ray's time; ambient: lightmap values."""
    p = world.hidden["specular"]
    dots, sky, keep = np.zeros(len(points)), np.zeros(len(points)), np.ones(len(points))
    glossy = np.flatnonzero(np.isin(index, [i for i, s in enumerate(world.solids) if world.is_glossy(s)]))
    if not glossy.size:
        return dots, sky, keep
    n, view, at = normals[glossy], -directions[glossy], points[glossy]
    fresnel = _schlick(p["f0"], np.einsum("ij,ij->i", n, view))
    keep[glossy] = 1.0 - fresnel
    dots[glossy] = _projector_glint(world, frame, at, n, view, poses, row[glossy], **p)
    sky[glossy] = fresnel * _surroundings(world, at, n, directions[glossy], ambient, p["roughness"])
    return dots, sky, keep


def _projector_glint(world, frame, points, n, view, poses, row, f0, roughness, everywhere):
    centre = (poses[:, :3, 0] * world.rig.projector_x_m + poses[:, :3, 3])[row]
    way = centre - points
    distance = np.linalg.norm(way, axis=1)
    light = way / distance[:, None]
    half = light + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    nl, nv, nh, vh = (
        np.maximum(np.einsum("ij,ij->i", a, b), 1e-6) for a, b in ((n, light), (n, view), (n, half), (view, half))
    )
    m2 = roughness**4
    facets = np.exp((nh**2 - 1) / (m2 * nh**2)) / (np.pi * m2 * nh**4)
    masking = np.minimum(1.0, np.minimum(2 * nh * nv / vh, 2 * nh * nl / vh))
    brdf = _schlick(f0, vh) * facets * masking / (4 * nl * nv)
    local = np.einsum("nji,nj->ni", poses[row, :3, :3], -way)
    value = brdf * nl * world.emitter.intensity(local, frame) / distance**2
    lit = np.flatnonzero(value > 0)
    value[lit] *= transmittance(world.solids, centre[lit], points[lit])
    return value


def _surroundings(world, points, normals, directions, ambient, roughness):
    """Returns radiance from around the mirror direction, under the sky, by four rays on the lobe's cone."""
    mirror = directions - 2 * np.einsum("ij,ij->i", directions, normals)[:, None] * normals
    total = np.zeros(len(points))
    for k in range(_LOBE):
        turn = 2 * np.pi * (k + 0.5) / _LOBE
        helper = np.cross(mirror, normals + 1e-6)
        helper /= np.linalg.norm(helper, axis=1, keepdims=True)
        spread = roughness**2 * (np.cos(turn) * helper + np.sin(turn) * np.cross(mirror, helper))
        way = mirror + spread
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        t, _, index = closest(world.solids, points, way)
        there = points + np.where(np.isfinite(t), t, 0.0)[:, None] * way
        total += np.where(
            index < 0, 1.0, albedo_of(world.solids, index, there) * world.lightmap.look_up(ambient, index, there)
        )
    return total / _LOBE


def _schlick(f0, cosine):
    return f0 + (1.0 - f0) * (1.0 - np.clip(cosine, 0, 1)) ** 5
