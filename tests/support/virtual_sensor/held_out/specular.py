# SPDX-License-Identifier: Apache-2.0
"""Adds gloss: Beckmann facets in V-shaped grooves (Torrance and Sparrow 1967) under Schlick's term; not GGX."""

import numpy as np

from virtual_sensor.held_out.caster import LIFT_M, albedo_of, closest, tangents, transmittance

_LOBE = 4
_GOLDEN = 0.61803398875


def glints(world, frame, directions, points, normals, index, poses, row, bounced, ambient, irradiance):
    """Returns for each ray: the projector's glint, the mirrored surroundings under the projector and under the sky, and
    the share of diffuse light that is left. poses[row]: the left camera's pose at each ray's time; bounced, ambient:
    lightmap values; irradiance(points, normals, row=...): the projector's, over pi."""
    p = world.hidden["specular"]
    dots, mirrored, sky, keep = (np.full(len(points), value) for value in (0.0, 0.0, 0.0, 1.0))
    glossy = np.flatnonzero(np.isin(index, [i for i, s in enumerate(world.solids) if world.is_glossy(s)]))
    if not glossy.size:
        return dots, mirrored, sky, keep
    n, view, at = normals[glossy], -directions[glossy], points[glossy]
    reflected = reflected_share(np.einsum("ij,ij->i", n, view), p["f0"], p["roughness"])
    keep[glossy] = 1.0 - reflected
    dots[glossy] = _projector_glint(world, frame, at, n, view, poses, row[glossy], **p)
    ways, weights = _lobe(n, view, p["f0"], p["roughness"])
    for way, share in zip(ways, reflected * weights / np.maximum(weights.sum(0), 1e-12), strict=True):
        t, facing, solid = closest(world.solids, at, way)
        hit = np.flatnonzero(solid >= 0)
        there, facing, i = at[hit] + t[hit, None] * way[hit] + LIFT_M * facing[hit], facing[hit], solid[hit]
        sky[glossy] += share * (solid < 0)
        share, here = share[hit] * albedo_of(world.solids, i, there), glossy[hit]
        sky[here] += share * world.lightmap.look_up(ambient, i, there)
        mirrored[here] += share * (world.lightmap.look_up(bounced, i, there) + irradiance(there, facing, row=row[here]))
    return dots, mirrored, sky, keep


def _projector_glint(world, frame, points, n, view, poses, row, f0, roughness, everywhere):
    centre = (poses[:, :3, 0] * world.rig.projector_x_m + poses[:, :3, 3])[row]
    way = centre - points
    distance = np.linalg.norm(way, axis=1)
    light = way / distance[:, None]
    half = light + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    nl, nv, nh, vh = _cosines(n, light, view, half)
    m2 = roughness**4
    facets = np.exp((nh**2 - 1) / (m2 * nh**2)) / (np.pi * m2 * nh**4)
    brdf = _schlick(f0, vh) * facets * _masking(nl, nv, nh, vh) / (4 * nl * nv)
    local = np.einsum("nji,nj->ni", poses[row, :3, :3], -way)
    value = brdf * nl * world.emitter.intensity(local, frame) / distance**2
    lit = np.flatnonzero(value > 0)
    value[lit] *= transmittance(world.solids, centre[lit], points[lit])
    return value


def _lobe(normals, view, f0, roughness):
    """Returns (directions [k][n][3] of light mirrored off drawn facets, the share [k][n] of it that is reflected)."""
    (tangent, bitangent), start = tangents(normals), np.arange(len(normals)) * _GOLDEN % 1.0
    ways, weights = [], []
    for k in range(_LOBE):
        tilt = _tilt((k + (start * 7.0 + 0.5) % 1.0) / _LOBE, roughness)
        turn = 2 * np.pi * (start + k * _GOLDEN)
        half = normals + tilt[:, None] * (np.cos(turn)[:, None] * tangent + np.sin(turn)[:, None] * bitangent)
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        ways.append(2.0 * np.einsum("ij,ij->i", view, half)[:, None] * half - view)
        weights.append(_reflected(f0, *_cosines(normals, ways[-1], view, half)))
    return ways, np.array(weights)


def reflected_share(cosine, f0, roughness, steps=48):
    """Returns the share of light that the coat reflects towards a camera at this cosine from the normal."""
    middle = (np.arange(steps) + 0.5) / steps
    known = np.linspace(0.02, 1.0, 40)
    nv, part, turn = np.meshgrid(known, middle, 2 * np.pi * middle, indexing="ij")
    tilt = _tilt(part, roughness)
    half = np.stack([tilt * np.cos(turn), tilt * np.sin(turn), np.ones_like(tilt)], -1) / np.hypot(1, tilt)[..., None]
    view = np.stack([np.sqrt(1 - nv**2), 0 * nv, nv], -1).reshape(-1, 3)
    half = half.reshape(-1, 3)
    way = 2.0 * np.einsum("ij,ij->i", view, half)[:, None] * half - view
    normal = np.broadcast_to([0.0, 0.0, 1.0], way.shape)
    shares = _reflected(f0, *_cosines(normal, way, view, half)).reshape(len(known), -1).mean(1)
    return np.interp(cosine, known, shares)


def _tilt(part, roughness):
    """Returns the tangent of the tilt that this part of Beckmann's facets does not exceed."""
    return roughness**2 * np.sqrt(-np.log(1.0 - part))


def _cosines(n, light, view, half):
    pairs = (n, light), (n, view), (n, half), (view, half)
    return tuple(np.maximum(np.einsum("ij,ij->i", a, b), 1e-6) for a, b in pairs)


def _masking(nl, nv, nh, vh):
    return np.minimum(1.0, np.minimum(2 * nh * nv / vh, 2 * nh * nl / vh))


def _reflected(f0, nl, nv, nh, vh):
    """Returns the share of light that facets drawn by number and area reflect. It is 0 for light from below."""
    return _schlick(f0, vh) * _masking(nl, nv, nh, vh) * vh / (nv * nh) * (nl > 1e-6) * (vh > 1e-6)


def _schlick(f0, cosine):
    return f0 + (1.0 - f0) * (1.0 - np.clip(cosine, 0, 1)) ** 5
