# SPDX-License-Identifier: Apache-2.0
"""Computes the light that leaves the scene towards the camera: a radiance image per light source."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import gammaincinv

from virtual_sensor.held_out.camera import axis_cosine
from virtual_sensor.held_out.caster import LIFT_M, albedo_of, closest, tangents, transmittance
from virtual_sensor.held_out.medium import backscatter, faded
from virtual_sensor.held_out.rig import look_at
from virtual_sensor.held_out.specular import glints

LAMP_POSITION = (1.1, 0.8, 0.5)
_RING = 12


@dataclass(frozen=True)
class Layers:
    """Radiance images [rows][columns] by light source, and depth. direct, indirect: the projector's light straight off
    a surface and otherwise, at power 1. sky: of radiance 1. other: a second projector at its own power. depth: metres,
    0 = no hit."""

    direct: np.ndarray
    indirect: np.ndarray
    sky: np.ndarray
    other: np.ndarray
    lamp: np.ndarray
    depth: np.ndarray

    def map(self, function):
        """Applies a function to each light image; depth stays."""
        return replace(
            self, **{name: function(getattr(self, name)) for name in ("direct", "indirect", "sky", "other", "lamp")}
        )


def shade(world, frame, camera_rays, shape, bounced, ambient):
    """Returns the Layers that rays see. bounced, ambient: lightmap values; shape: (rows, columns)."""
    origins, directions, row, poses = camera_rays
    t, normal, index = closest(world.solids, origins, directions)
    lights = _lights(world, frame, origins, directions, row, poses, (t, normal, index), bounced, ambient)
    if "transmission" in world.hidden:
        lights = _seen_through(world, frame, camera_rays, (t, normal, index), lights, bounced, ambient)
    if "haze" in world.hidden:
        lights = faded(lights, origins, directions, t, _projector_centres(world, poses, row), **world.hidden["haze"])
        lights[1] = lights[1] + backscatter(world, frame, origins, directions, t, row, poses, **world.hidden["haze"])
    return Layers(*(value.reshape(shape) for value in (*lights, depth_along(camera_rays, t, index))))


def depth_along(camera_rays, t, index):
    """Returns the depth [n] of the rays' hits at distance t, 0 without a hit (index -1)."""
    _, directions, row, poses = camera_rays
    return np.where(index >= 0, np.where(index >= 0, t, 0.0) * axis_cosine(directions, poses, row), 0.0)


def projector_irradiance(world, frame, points, normals, poses, row, coarse=False):
    """Returns irradiance / pi at points [n][3] from the rig's projector. poses[row]: the left camera's."""
    centre = _projector_centres(world, poses, row)
    way = points - centre
    local = np.einsum("nji,nj->ni", poses[row, :3, :3], way)
    distance = np.linalg.norm(way, axis=1)
    cosine = -np.einsum("ij,ij->i", normals, way) / distance
    intensity = np.where(cosine > 0, world.emitter.intensity(local, frame, coarse), 0.0)
    value = intensity * np.maximum(cosine, 0.0) / (np.pi * distance**2)
    lit = np.flatnonzero(value > 0)
    value[lit] *= transmittance(world.solids, centre[lit], points[lit], _clear_solids(world))
    return value


def _projector_centres(world, poses, row):
    centres = poses[:, :3, 0] * world.rig.projector_x_m + poses[:, :3, 3]
    return centres[row]


def _clear_solids(world):
    if "transmission" not in world.hidden:
        return None
    return {i: world.hidden["transmission"]["share"] for i, s in enumerate(world.solids) if world.is_clear(s)}


def _lights(world, frame, origins, directions, row, poses, hits, bounced, ambient):
    """Returns the radiances [direct, indirect, sky, other, lamp] along the rays."""
    t, normal, index = hits
    count = len(directions)
    lights = [np.zeros(count) for _ in range(5)]
    hit = np.flatnonzero(index >= 0)
    points = origins[hit] + t[hit, None] * directions[hit] + LIFT_M * normal[hit]
    albedo, n, i = albedo_of(world.solids, index[hit], points), normal[hit], index[hit]
    lights[0][hit] = albedo * _direct(world, frame, points, n, i, poses, row[hit])
    lights[1][hit] = albedo * world.lightmap.look_up(bounced, i, points)
    lights[2][hit] = albedo * world.lightmap.look_up(ambient, i, points)
    lights[2][index < 0] = 1.0
    if "second_projector" in world.hidden:
        lights[3][hit] = albedo * _second_projector(
            world, frame, points, n, poses, row[hit], **world.hidden["second_projector"]
        )
    if "ambient_ir" in world.hidden:
        lights[4][hit] = albedo * _lamp(world, points, n, **world.hidden["ambient_ir"])
    if "specular" in world.hidden:
        irradiance = partial(projector_irradiance, world, frame, poses=poses, coarse=True)
        *added, keep = glints(
            world, frame, directions[hit], points, n, i, poses, row[hit], bounced, ambient, irradiance
        )
        for k in range(5):
            lights[k][hit] *= keep
        for k, light in enumerate(added):
            lights[k][hit] += light
    return lights


def _direct(world, frame, points, normals, index, poses, row):
    if "subsurface" not in world.hidden:
        return projector_irradiance(world, frame, points, normals, poses, row)
    value = np.zeros(len(points))
    wax = np.isin(index, [i for i, s in enumerate(world.solids) if world.is_wax(s)])
    hard = np.flatnonzero(~wax)
    value[hard] = projector_irradiance(world, frame, points[hard], normals[hard], poses, row[hard])
    soft = np.flatnonzero(wax)
    if soft.size:
        value[soft] = _diffused(
            world, frame, points[soft], normals[soft], poses, row[soft], **world.hidden["subsurface"]
        )
    return value


def _diffused(world, frame, points, normals, poses, row, length_m, everywhere):
    """Returns irradiance / pi leaving a translucent surface; light enters around by density exp(-r / length_m)."""
    tangent, bitangent = tangents(normals)
    start = (np.arange(len(points)) * 0.61803398875) % 1.0 * 2 * np.pi
    total = np.zeros(len(points))
    for k in range(_RING):
        radius = length_m * gammaincinv(2, (k + 0.5) / _RING)  # a quantile of the density r exp(-r)
        angle = start + 2 * np.pi * k * 0.38196601125
        around = points + radius * (np.cos(angle)[:, None] * tangent + np.sin(angle)[:, None] * bitangent)
        total += projector_irradiance(world, frame, around, normals, poses, row)
    return total / _RING


def second_unit_poses(rig, poses, on_rig, beside_m, yaw_rad):
    """Returns the second unit's pose [n][4][4] at each of the left camera. on_rig: > 0 on the rig, else in the room."""
    if on_rig <= 0:
        return np.broadcast_to(look_at((np.sign(beside_m) * 0.45, 0.5, 0.45), (0.0, 0.05, -0.25)), poses.shape)
    turn = np.array([[np.cos(yaw_rad), 0, np.sin(yaw_rad)], [0, 1, 0], [-np.sin(yaw_rad), 0, np.cos(yaw_rad)]])
    placed = poses.copy()
    placed[:, :3, 3] = poses[:, :3, 0] * (rig.projector_x_m + beside_m) + poses[:, :3, 3]
    placed[:, :3, :3] = poses[:, :3, :3] @ turn
    return placed


def _second_projector(world, frame, points, normals, poses, row, power, on_rig, beside_m, yaw_rad):
    """Returns irradiance / pi at points from another unit's projector with the same pattern."""
    placed = second_unit_poses(world.rig, poses, on_rig, beside_m, yaw_rad)
    centre, rotation = placed[:, :3, 3][row], placed[:, :3, :3][row]
    way = points - centre
    distance = np.linalg.norm(way, axis=1)
    cosine = np.maximum(-np.einsum("ij,ij->i", normals, way) / distance, 0.0)
    value = (
        power * world.emitter.intensity(np.einsum("nji,nj->ni", rotation, way), frame) * cosine / (np.pi * distance**2)
    )
    lit = np.flatnonzero(value > 0)
    value[lit] *= transmittance(world.solids, centre[lit], points[lit])
    return value


def _lamp(world, points, normals, strength):
    """Returns irradiance / pi at points from a small lamp aside. strength: at one metre, facing it."""
    position = np.asarray(LAMP_POSITION)
    way = position - points
    distance = np.linalg.norm(way, axis=1)
    value = strength * np.maximum(np.einsum("ij,ij->i", normals, way) / distance, 0.0) / distance**2
    lit = np.flatnonzero(value > 0)
    value[lit] *= transmittance(world.solids, np.broadcast_to(position, (len(lit), 3)), points[lit])
    return value


def _seen_through(world, frame, camera_rays, hits, lights, bounced, ambient):
    """Adds a share of the light behind thin clear walls to the light that the walls themselves show."""
    origins, directions, row, poses = camera_rays
    share = world.hidden["transmission"]["share"]
    for i, solid in enumerate(world.solids):
        here = np.flatnonzero(hits[2] == i) if world.is_clear(solid) else np.zeros(0, int)
        if not here.size:
            continue
        behind = closest(world.solids, origins[here], directions[here], skip=np.full(len(here), i))
        seen = _lights(world, frame, origins[here], directions[here], row[here], poses, behind, bounced, ambient)
        for k in range(5):
            lights[k][here] = (1 - share) * lights[k][here] + share * seen[k]
    return lights
