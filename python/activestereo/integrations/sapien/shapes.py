# SPDX-License-Identifier: Apache-2.0
"""SAPIEN's render shapes, visual records and collision shapes as meshes, in the shape's own frame, scale included.

SAPIEN's cylinders and capsules lie along x, its planes face along x. kuafu's meshes get the names of SAPIEN's classes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
from activestereo.scene_io import solids
from activestereo.scene_io.meshes import Mesh

# Half the side of a collision plane, which SAPIEN has endless, in metres.
_ENDLESS_M = 50.0
_GREY = (0.6, 0.6, 0.6, 1.0)


@dataclass(frozen=True)
class Part:
    """A mesh in its shape's frame with one material. normals and uvs are absent if the source has none."""

    positions: NDArray[np.float32]
    indices: NDArray[np.uint32]
    normals: NDArray[np.float32] | None
    uvs: NDArray[np.float32] | None
    scale: ArrayLike
    material: Any  # kuafu.Material, SAPIEN's RenderMaterial, or None


def render_parts(shape: Any) -> Iterator[Part]:
    """The parts of a RenderShape: SAPIEN gives box, sphere, cylinder and plane at unit size, capsules at their own."""
    kind = type(shape).__name__
    if kind == "RenderShapeBox":
        scale = shape.half_size
    elif kind == "RenderShapeSphere":
        scale = [shape.radius] * 3
    elif kind == "RenderShapeCylinder":
        scale = [shape.half_length, shape.radius, shape.radius]
    elif kind in ("RenderShapePlane", "RenderShapeTriangleMesh"):
        scale = shape.scale
    else:
        scale = [1.0, 1.0, 1.0]
    for part in shape.parts:
        normals, uvs = part.get_vertex_normal(), part.get_vertex_uv()
        positions = _floats(part.vertices)
        yield Part(
            positions,
            np.ascontiguousarray(part.triangles, np.uint32),
            _floats(normals) if len(normals) == len(positions) else None,
            _floats(uvs) if len(uvs) == len(positions) else None,
            scale,
            part.material,
        )


def record_parts(record: Any) -> Iterator[Part]:
    """The parts of a VisualShapeRecord."""
    if record.type == "file":
        yield from _file_parts(record.filename, record.scale, record.material)
        return
    mesh, scale = _solid(record.type, record.scale, record.radius, record.length)
    yield _make_part(mesh, scale, record.material or kuafu.Material(base_color=_GREY))


def collision_parts(shape: Any) -> Iterator[Part]:
    """The parts of a PhysxCollisionShape, in grey, for an entity without looks."""
    kind = type(shape).__name__.removeprefix("PhysxCollisionShape")
    grey = kuafu.Material(name="collision shape", base_color=_GREY)
    if kind in ("ConvexMesh", "TriangleMesh"):
        triangles = np.ascontiguousarray(shape.triangles, np.uint32)
        yield Part(_floats(shape.vertices), triangles, None, None, shape.scale, grey)
        return
    size = getattr(shape, "half_size", [_ENDLESS_M] * 3)
    mesh, scale = _solid(kind.lower(), size, getattr(shape, "radius", 1.0), getattr(shape, "half_length", 1.0))
    yield _make_part(mesh, scale, grey)


def _solid(kind: str, size: ArrayLike, radius: float, half_length: float) -> tuple[Mesh, ArrayLike]:
    if kind == "box":
        return solids.box(), size
    if kind == "sphere":
        return solids.sphere(), [radius] * 3
    if kind == "cylinder":
        return solids.turned(solids.cylinder(), solids.Z_TO_X), [half_length, radius, radius]
    if kind == "capsule":
        return solids.turned(solids.capsule(float(radius), float(half_length)), solids.Z_TO_X), [1.0, 1.0, 1.0]
    if kind == "plane":
        return solids.turned(solids.rectangle(), solids.Z_TO_X), size
    raise ValueError(f"SAPIEN's shape '{kind}' has no likeness in a kuafu scene")


def _file_parts(path: str, scale: ArrayLike, material: Any) -> Iterator[Part]:
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(f"{path} is read by the package trimesh, which is missing: pip install trimesh") from error
    try:
        loaded = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # errors of trimesh's many readers
        raise ValueError(f"{path}: no mesh could be read: {error}") from error
    yield Part(
        _floats(loaded.vertices),
        np.ascontiguousarray(loaded.faces, np.uint32),
        _floats(loaded.vertex_normals),
        None,
        scale,
        material or kuafu.Material(base_color=_GREY),
    )


def _make_part(mesh: Mesh, scale: ArrayLike, material: Any) -> Part:
    return Part(mesh.positions, mesh.indices, mesh.normals, mesh.uvs, scale, material)


def _floats(values: ArrayLike) -> NDArray[np.float32]:
    return np.ascontiguousarray(values, np.float32)
