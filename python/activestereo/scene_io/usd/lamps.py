# SPDX-License-Identifier: Apache-2.0
"""Lights of a stage: those with an extent as surfaces that shine, distant ones as glTF's directional lights.

USD's intensity times colour times 2^exposure is a radiance, taken in W/(sr m^2).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.meshes import Mesh
from activestereo.scene_io.usd.stage import Stage

_LEAST_RADIUS = 1e-4  # of a sphere in stage units that shines as a surface
_BEHIND = 1e-4  # of a lamp's size: how far its dark back lies behind it


def radiance(stage: Stage, api: Any) -> np.ndarray:
    """Linear RGB, before normalize."""
    color = np.array(stage.value(api.GetColorAttr(), (1, 1, 1)), dtype=float)
    if stage.value(api.GetEnableColorTemperatureAttr(), False):
        stage.tell("lights' colour temperatures are not read: their colours stand")
    level = float(stage.value(api.GetIntensityAttr(), 1.0)) * 2.0 ** float(stage.value(api.GetExposureAttr(), 0.0))
    return color * level


def add_lamp(stage: Stage, writer: GltfWriter, prim: Any, to_stage: np.ndarray, to_world: np.ndarray) -> None:
    """A light that is no dome. Matrices 4x4 from the light to the stage's unit and to metres."""
    from pxr import UsdLux

    name, api = str(prim.GetPath()), UsdLux.LightAPI(prim)
    shines = radiance(stage, api)
    normalize = bool(stage.value(api.GetNormalizeAttr(), False))
    if prim.IsA(UsdLux.DistantLight):
        half = np.deg2rad(float(stage.value(UsdLux.DistantLight(prim).GetAngleAttr(), 0.53))) / 2
        irradiance = shines if normalize or half == 0 else shines * np.pi * np.sin(half) ** 2
        if half > np.deg2rad(0.5):
            stage.tell(f"{name}: light from {2 * np.rad2deg(half):.1f} degrees of the sky comes from its middle alone")
        peak = max(float(irradiance.max()), 1e-30)
        writer.add_directional_light(name, _rotation(to_world), (irradiance / peak).tolist(), peak)
        return
    shape = _shape(stage, prim)
    if shape is None:
        stage.tell(f"{name}: lights of type {prim.GetTypeName()} are not read")
        return
    front, back = shape
    if normalize:
        shines = shines / _area(front, to_stage)
    writer.add_placed_mesh(name, front, _emitter(writer, name, shines), to_world)
    if back is not None:
        dark = {"baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0}
        writer.add_placed_mesh(
            f"{name} back", back, writer.add_material("a lamp's back", pbrMetallicRoughness=dark), to_world
        )


def _shape(stage: Stage, prim: Any) -> tuple[Mesh, Mesh | None] | None:
    """(what shines, its dark back); None: it is of another kind."""
    from pxr import UsdLux

    if prim.IsA(UsdLux.SphereLight):
        radius = float(stage.value(UsdLux.SphereLight(prim).GetRadiusAttr(), 0.5))
        return meshes.sphere(max(radius, _LEAST_RADIUS)), None
    if prim.IsA(UsdLux.DiskLight):
        radius = float(stage.value(UsdLux.DiskLight(prim).GetRadiusAttr(), 0.5))
        return _disk(radius, 0.0, -1.0), _disk(radius, _BEHIND * radius, 1.0)
    if prim.IsA(UsdLux.RectLight):
        rect = UsdLux.RectLight(prim)
        width, height = (float(stage.value(a, 1.0)) for a in (rect.GetWidthAttr(), rect.GetHeightAttr()))
        if rect.GetTextureFileAttr() and stage.value(rect.GetTextureFileAttr()) is not None:
            stage.tell(f"{prim.GetPath()}: its texture is not read")
        back = _BEHIND * max(width, height)
        return (
            meshes.sheet((width / 2, -height / 2, 0), (-width, 0, 0), (0, height, 0)),
            meshes.sheet((-width / 2, -height / 2, back), (width, 0, 0), (0, height, 0)),
        )
    return None


def _disk(radius: float, z: float, facing: float) -> Mesh:
    """A disk across z, whose normal is `facing` along z."""
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False) * facing
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(64, z)], axis=1)
    points = np.vstack([[[0, 0, z]], rim])
    ring = np.arange(1, 65)
    triangles = np.stack([np.zeros(64, int), ring, np.roll(ring, -1)], axis=1)
    return Mesh.of(points, [[0, 0, facing]] * 65, np.zeros((65, 2)), triangles)


def _emitter(writer: GltfWriter, name: str, shines: np.ndarray) -> int:
    peak = max(float(shines.max()), 1e-30)
    return writer.add_material(
        name,
        pbrMetallicRoughness={"baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0},
        emissiveFactor=(shines / peak).tolist(),
        extensions={
            "KHR_materials_emissive_strength": {"emissiveStrength": peak},
            "KHR_materials_specular": {"specularFactor": 0.0},
        },
    )


def _area(mesh: Mesh, to_stage: np.ndarray) -> float:
    edges = (mesh.positions @ to_stage[:3, :3].T)[mesh.indices]
    return 0.5 * float(np.linalg.norm(np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0]), axis=1).sum())


def _rotation(matrix: np.ndarray) -> np.ndarray:
    out = matrix.copy()
    out[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
    return out
