# SPDX-License-Identifier: Apache-2.0
"""Makes meshes of physics engines' solids. Units are metres; solids are centred at the origin with z as their axis;
triangles are counter-clockwise from outside."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from activestereo.scene_io import meshes
from activestereo.scene_io.meshes import Mesh

# Rows: new x, y, z in terms of the lathe's axes, whose y is up.
_Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# The same for solids that lie along x, as SAPIEN has them.
Z_TO_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
Z_TO_X.setflags(write=False)


@cache
def box() -> Mesh:
    """Returns a cube with sides of 2: scaled by half sizes it is any box."""
    cube = meshes.box(2.0, 2.0, 2.0)
    return turned(
        Mesh.from_arrays(cube.positions - [0.0, 1.0, 0.0], cube.normals, cube.uvs, cube.indices), _Y_UP_TO_Z_UP
    )


@cache
def sphere() -> Mesh:
    """Returns a sphere of radius 1: scaled it is any sphere or ellipsoid."""
    return turned(meshes.sphere(1.0), _Y_UP_TO_Z_UP)


@cache
def cylinder() -> Mesh:
    """Returns a cylinder of radius 1, from z = -1 to 1."""
    return turned(meshes.lathe([[(0, -1), (1, -1)], [(1, -1), (1, 1)], [(1, 1), (0, 1)]]), _Y_UP_TO_Z_UP)


@cache
def capsule(radius_m: float, half_length_m: float) -> Mesh:
    """Returns a capsule of final size, because scaling would distort its ends. half_length_m: half the length of the
    cylinder between its half spheres."""
    profile = np.vstack(
        [meshes.arc((0.0, -half_length_m), radius_m, -90.0, 0.0), meshes.arc((0.0, half_length_m), radius_m, 0.0, 90.0)]
    )
    profile[[0, -1], 0] = 0.0
    return turned(meshes.lathe([profile]), _Y_UP_TO_Z_UP)


@cache
def rectangle() -> Mesh:
    """Returns a square with sides of 2 in the plane z = 0, visible from above."""
    return meshes.sheet((-1.0, -1.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0))


def turned(mesh: Mesh, rotation: NDArray[np.float64]) -> Mesh:
    """Returns the mesh rotated by a 3x3, which maps its axes to the new ones."""
    return Mesh.from_arrays(mesh.positions @ rotation.T, mesh.normals @ rotation.T, mesh.uvs, mesh.indices)


def height_field(heights_m: NDArray[np.float64], half_x_m: float, half_y_m: float) -> Mesh:
    """Makes a mesh of a grid of heights [rows, columns] over a rectangle; rows go along y, columns along x."""
    rows, columns = heights_m.shape
    x, y = np.linspace(-half_x_m, half_x_m, columns), np.linspace(-half_y_m, half_y_m, rows)
    slope_y, slope_x = np.gradient(heights_m, y, x)
    normals = np.stack([-slope_x, -slope_y, np.ones_like(heights_m)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    xx, yy = np.meshgrid(x, y)
    uvs = np.stack(np.meshgrid(np.linspace(0, 1, columns), np.linspace(1, 0, rows)), axis=-1)
    points = np.stack([xx, yy, heights_m], axis=-1)
    return Mesh.from_arrays(
        points.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2), meshes.grid(rows, columns)
    )
