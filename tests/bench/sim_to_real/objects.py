# SPDX-License-Identifier: Apache-2.0
"""Eight objects from clay to glass. Metres, z up; the origin is the centre of symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
from activestereo.scene_io import meshes
from activestereo.scene_io.meshes import Mesh

_ALONE = np.eye(3)[None]
_UPSIDE_DOWN = np.stack([np.eye(3), np.diag([1.0, -1.0, -1.0])])
_HALF_TURNS = np.stack([np.diag(d) for d in ([1.0, 1, 1], [1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1])])


@dataclass(frozen=True)
class BenchmarkObject:
    """turns: [n, 3, 3], rotations that map the object to itself. is_round: so do all turns about z. rest_m: the
    origin's height on a table."""

    name: str
    mesh: Mesh
    material: kuafu.Material
    turns: NDArray[np.float64]
    is_round: bool
    rest_m: float


@dataclass(frozen=True)
class Surface:
    """Points of an object's surface, spread evenly: points, normals float64 [n, 3]."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]


@cache
def objects() -> tuple[BenchmarkObject, ...]:
    can = meshes.lathe([[(0, 0), (0.03, 0)], [(0.03, 0), (0.03, 0.11)], [(0.03, 0.11), (0, 0.11)]])
    return (
        _made("clay block", meshes.box(0.12, 0.07, 0.08), _paint(0.6, 1.0, specular=0.0), _HALF_TURNS),
        _made("steel block", meshes.box(0.1, 0.05, 0.07), _metal(0.65, 0.3), _HALF_TURNS),
        _made("glazed vase", meshes.vase(0.14), _paint(0.3, 0.15), _ALONE, is_round=True),
        _made("brass can", can, _metal(0.8, 0.2), _UPSIDE_DOWN, is_round=True),
        _made("glass", meshes.tumbler(0.036, 0.1, 0.0035, 0.012), _glass(), _ALONE, is_round=True),
        _made("rubber bracket", _bracket(), _paint(0.06, 0.6), _ALONE),
        _made("plastic mug", _mug(), _paint(0.7, 0.25), _ALONE),
        _made("lacquered stairs", _stairs(), _paint(0.8, 0.08), _ALONE),
    )


def surface(mesh: Mesh, count: int, seed: int = 0) -> Surface:
    """`count` points, each as likely anywhere on the mesh."""
    random = np.random.default_rng(seed)
    corners = mesh.positions.astype(np.float64)[mesh.indices.reshape(-1, 3)]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    chosen = random.choice(len(area), count, p=area / area.sum())
    uv = random.random((count, 2))
    uv[uv.sum(axis=1) > 1.0] = 1.0 - uv[uv.sum(axis=1) > 1.0]
    a, b, c = (corners[chosen, k] for k in range(3))
    return Surface(a + uv[:, :1] * (b - a) + uv[:, 1:] * (c - a), normal[chosen] / area[chosen, None])


def _made(
    name: str, mesh: Mesh, material: kuafu.Material, turns: NDArray[np.float64], is_round: bool = False
) -> BenchmarkObject:
    """Makes an object from a mesh with y up that stands on y = 0."""
    points = mesh.positions.astype(np.float64)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    if is_round:
        middle[[0, 2]] = 0.0
    up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    upright = Mesh.from_arrays((points - middle) @ up.T, mesh.normals @ up.T, mesh.uvs, mesh.indices)
    material.name = name
    return BenchmarkObject(name, upright, material, turns, is_round, float(middle[1]))


def _paint(albedo: float, roughness: float, specular: float = 0.5) -> kuafu.Material:
    color = (albedo, albedo, albedo, 1.0)
    return kuafu.Material(base_color=color, metallic=0.0, roughness=roughness, specular=specular, ir_albedo=albedo)


def _metal(reflectance: float, roughness: float) -> kuafu.Material:
    color = (reflectance, reflectance, reflectance, 1.0)
    return kuafu.Material(base_color=color, metallic=1.0, roughness=roughness, ir_albedo=reflectance)


def _glass() -> kuafu.Material:
    return kuafu.Material(base_color=(1.0, 1.0, 1.0, 1.0), metallic=0.0, roughness=0.0, transmission=1.0, ior=1.5)


def _bracket() -> Mesh:
    """An L that stands on its long leg, with a rib at one end."""
    legs = [(meshes.box(0.12, 0.02, 0.06), (0, 0, 0)), (meshes.box(0.02, 0.08, 0.06), (-0.05, 0.02, 0))]
    return _joined(*legs, (meshes.box(0.02, 0.02, 0.02), (0.05, 0.02, 0.02)))


def _mug() -> Mesh:
    handle = [
        (meshes.box(0.025, 0.01, 0.014), (0.045, 0.02, 0)),
        (meshes.box(0.025, 0.01, 0.014), (0.045, 0.065, 0)),
        (meshes.box(0.01, 0.055, 0.014), (0.0575, 0.02, 0)),
    ]
    return _joined((meshes.tumbler(0.036, 0.09, 0.004, 0.006), (0, 0, 0)), *handle)


def _stairs() -> Mesh:
    steps = [(meshes.box(0.04, height, 0.06), (x, 0, 0)) for x, height in ((-0.04, 0.09), (0, 0.06), (0.04, 0.03))]
    return _joined(*steps, (meshes.box(0.02, 0.02, 0.02), (0.04, 0.03, -0.02)))


def _joined(*parts: tuple[Mesh, ArrayLike]) -> Mesh:
    return meshes.joined(
        [Mesh.from_arrays(m.positions + np.asarray(at), m.normals, m.uvs, m.indices) for m, at in parts]
    )
