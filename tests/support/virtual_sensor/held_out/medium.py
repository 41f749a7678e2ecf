# SPDX-License-Identifier: Apache-2.0
"""Simulates haze: Beer-Lambert fading, scattered ambient light, and the projector's beam seen from the side."""

import numpy as np

_STEPS = 16
_NEAR_M, _FAR_M = 0.06, 2.0


def faded(lights, origins, directions, t, projector_centres, extinction_per_m):
    """Returns the lights [direct, indirect, sky, other, lamp] after the haze. t: hit distances in metres, or inf."""
    reached = np.isfinite(t)
    points = origins + np.where(reached, t, 0.0)[:, None] * directions
    from_projector = np.linalg.norm(points - projector_centres, axis=1)
    seen = np.where(reached, np.exp(-extinction_per_m * np.where(reached, t, 0.0)), 0.0)
    lit = np.exp(-extinction_per_m * from_projector)
    direct, indirect, sky, other, lamp = lights
    sky = np.where(reached, sky * seen + 1.0 - seen, sky)
    return [direct * seen * lit, indirect * seen * lit, sky, other * seen, lamp * seen]


def backscatter(world, frame, origins, directions, t, row, poses, extinction_per_m):
    """Returns the rig's own beam scattered once, isotropically, towards the camera along each ray. It sums midpoints in
    log distance and leaves out shadows in the haze. t: hit distances in metres, inf for none."""
    centres = (poses[:, :3, 0] * world.rig.projector_x_m + poses[:, :3, 3])[row]
    edges = np.geomspace(_NEAR_M, _FAR_M, _STEPS + 1)
    total = np.zeros(len(directions))
    for near, far in zip(edges[:-1], edges[1:], strict=True):
        s = np.sqrt(near * far)
        way = origins + s * directions - centres
        local = np.einsum("nji,nj->ni", poses[row, :3, :3], way)
        distance = np.linalg.norm(way, axis=1)
        light = world.emitter.intensity(local, frame, coarse=True) / distance**2
        total += np.where(t > s, light * np.exp(-extinction_per_m * (s + distance)), 0.0) * (far - near)
    return extinction_per_m / (4 * np.pi) * total
