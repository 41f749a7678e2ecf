# SPDX-License-Identifier: Apache-2.0
"""Draws table-top scenes, and the scene that a user would measure with errors."""

from dataclasses import replace

import numpy as np

from virtual_sensor.cylinder import Cylinder
from virtual_sensor.solids import Box, Sphere
from virtual_sensor.tiles import Tiles

TEXEL_M = {"table": 0.022, "wall": 0.04}
OBJECT_TEXEL_M = 0.013
CLEARANCE_M = 0.02
# Tolerances of the believed scene: errors are drawn up to these values to both sides.
POSITION_M, TILT_RAD, ALBEDO = 1e-3, np.radians(0.25), 0.03


def draw_scene(rng):
    """Draws a scene's solids: table at y = 0, wall, two boxes, ball, standing can, lying pipe; y is up."""
    table = Tiles("table", (0.0, 0.0, -0.1), (0.0, 0.0, 0.8), (1.3, 0.0, 0.0), _tile_albedo(rng, 30, 48))
    wall = Tiles(
        "wall", (0.0, 0.5, rng.uniform(-0.8, -0.65)), (1.3, 0.0, 0.0), (0.0, 0.55, 0.0), _tile_albedo(rng, 44, 12)
    )
    objects, footprints = [], []
    for make in (_box("box1"), _box("box2"), _ball, _can, _pipe):
        while True:
            x, z = rng.uniform(-0.42, 0.42), rng.uniform(-0.45, 0.12)
            solid, radius = make(rng, x, z)
            if all(np.hypot(x - a, z - b) > radius + r + CLEARANCE_M for a, b, r in footprints):
                break
        objects.append(solid)
        footprints.append((x, z, radius))
    return (table, wall, *objects)


def texel_spacing(solids):
    return [TEXEL_M.get(solid.name, OBJECT_TEXEL_M) for solid in solids]


def measured_solids(solids, rng, amount):
    """Returns the solids as measured, with errors in places, angles and albedos. amount: 1 = usual."""
    return tuple(_measured(solid, rng, amount) for solid in solids)


def _measured(solid, rng, amount):
    shift = amount * POSITION_M * rng.uniform(-1, 1, 3)
    tilt = amount * TILT_RAD * rng.uniform(-1, 1, 2)
    gain = 1.0 + amount * ALBEDO * rng.uniform(-1, 1)
    moved = replace(solid, centre=tuple(np.asarray(solid.centre) + shift))
    if isinstance(solid, Tiles):
        albedo = tuple(tuple(row) for row in np.clip(gain * np.asarray(solid.albedo), 0, 1))
        return replace(moved, albedo=albedo, u=_tilted(solid.u, solid.v, tilt[0]), v=_tilted(solid.v, solid.u, tilt[1]))
    moved = replace(moved, albedo=min(1.0, gain * solid.albedo))
    if isinstance(solid, Box):
        return replace(moved, yaw=solid.yaw + tilt[0])
    if isinstance(solid, Cylinder) and abs(solid.axis[1]) < 0.5:
        c, s = np.cos(tilt[0]), np.sin(tilt[0])
        x, _, z = solid.axis
        return replace(moved, axis=(c * x + s * z, 0.0, c * z - s * x))
    return moved


def _tilted(edge, other, angle):
    """Returns the vector `edge` turned out of the plane of both, about `other`, by `angle` radians."""
    edge = np.asarray(edge, dtype=np.float64)
    out = np.cross(edge, other)
    out *= np.linalg.norm(edge) / np.linalg.norm(out)
    return tuple(np.cos(angle) * edge + np.sin(angle) * out)


def _tile_albedo(rng, rows, columns):
    """Draws tile albedos [rows][columns] in four shades; a third copy their neighbour, which makes patches."""
    shades = rng.uniform((0.08, 0.25, 0.45, 0.7), (0.2, 0.4, 0.65, 0.88))
    grid = rng.choice(shades, (rows, columns))
    copies = rng.random((rows, columns)) < 0.33
    grid[:, 1:] = np.where(copies[:, 1:], grid[:, :-1], grid[:, 1:])
    return tuple(tuple(float(a) for a in row) for row in grid)


def _box(name):
    def make(rng, x, z):
        half = rng.uniform((0.05, 0.05, 0.04), (0.1, 0.11, 0.09))
        solid = Box(name, (x, half[1] - 0.001, z), tuple(half), rng.uniform(-0.8, 0.8), rng.uniform(0.2, 0.8))
        return solid, float(np.hypot(half[0], half[2]))

    return make


def _ball(rng, x, z):
    radius = rng.uniform(0.07, 0.11)
    return Sphere("ball", (x, radius - 0.001, z), radius, rng.uniform(0.3, 0.85)), radius


def _can(rng, x, z):
    radius, half = rng.uniform(0.04, 0.065), rng.uniform(0.07, 0.11)
    return Cylinder("can", (x, half - 0.001, z), (0.0, 1.0, 0.0), radius, half, rng.uniform(0.25, 0.8)), radius


def _pipe(rng, x, z):
    radius, half, turn = rng.uniform(0.03, 0.05), rng.uniform(0.08, 0.12), rng.uniform(0, np.pi)
    solid = Cylinder(
        "pipe", (x, radius - 0.001, z), (np.cos(turn), 0.0, np.sin(turn)), radius, half, rng.uniform(0.25, 0.8)
    )
    return solid, float(np.hypot(half, radius))


def gltf_pieces(solids):
    """Splits the solids into pieces of one material each, one for each glTF node."""
    return [piece for solid in solids for piece in (solid.pieces() if isinstance(solid, Tiles) else [solid])]
