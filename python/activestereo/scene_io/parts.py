# SPDX-License-Identifier: Apache-2.0
"""Reads meshes and materials from files with kuafu, for scenes put together in Python: CAD parts, robots, models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

import kuafu
from activestereo.scene_io.meshes import Mesh

CREASE_DEG = 40.0
LARGEST_M = 5.0
_TEXTURES = tuple(name for name in dir(kuafu.Material) if name.endswith("_texture"))


@dataclass(frozen=True)
class Part:
    """A mesh of one material. colors: linear RGBA of the vertices [n, 4], or None. material: None if the file has none.
    textures: {texture field of the material: image, as Scene.get_texture gives it}."""

    mesh: Mesh
    colors: NDArray[np.float32] | None = None
    material: kuafu.Material | None = None
    textures: Mapping[str, dict[str, Any]] = field(default_factory=dict)


def add_parts(scene: kuafu.Scene, parts: Sequence[Part], name: str) -> list[tuple[int, int]]:
    """Adds a file's parts to a scene, and each image once. Returns (mesh number, material number) of each part."""
    numbers: dict[int, int] = {}
    out = []
    for part in parts:
        material = part.material or kuafu.Material(specular=0.0)  # white, which the vertex colours multiply
        material.name = material.name or name
        for key in _TEXTURES:
            image = part.textures.get(key)
            if image is not None and id(image) not in numbers:
                numbers[id(image)] = scene.add_texture(**image)
            setattr(material, key, None if image is None else numbers[id(image)])
        mesh = part.mesh
        arrays = {"normals": mesh.normals, "uvs": mesh.uvs, "colors": part.colors}
        out.append((scene.add_mesh(mesh.positions, mesh.indices, name=name, **arrays), scene.add_material(material)))
    return out


def read_parts(path: str | Path) -> list[Part]:
    """Reads the parts of a .obj, .ply, .stl, .dae, .gltf or .glb file, in the file's axes and unit (Collada and glTF:
    metres). If the file has no normals, _shaded() makes them. Raises ValueError with the file and its fault."""
    scene = kuafu.Scene(_device())
    try:
        scene.load(path)
    except kuafu.Error as error:
        raise ValueError(str(error)) from error
    images = [scene.get_texture(number) for number in range(scene.summary.texture_count)]
    parts = []
    for number in range(scene.summary.instance_count):
        instance = scene.get_instance(number)
        arrays = scene.get_mesh(instance["mesh"])
        slots = arrays["slots"] if arrays["slots"] is not None else np.zeros(len(arrays["indices"]), np.uint32)
        for slot in np.unique(slots):
            own = instance["materials"][slot] if slot < len(instance["materials"]) else None
            faces, to_world = arrays["indices"][slots == slot], instance["local_to_world"]
            points = arrays["positions"] @ to_world[:3, :3].T + to_world[:3, 3]
            uvs, colors = arrays["uvs"], arrays["colors"]
            if arrays["normals"] is None:
                mesh = _shaded(points, faces, uvs)
                colors = None if colors is None else colors[faces.ravel()]
            else:
                normals = arrays["normals"] @ np.linalg.inv(to_world[:3, :3])
                normals /= np.linalg.norm(normals, axis=1, keepdims=True)
                mesh = Mesh.from_arrays(points, normals, np.zeros((len(points), 2)) if uvs is None else uvs, faces)
            material = None if own is None else scene.get_material(own)
            numbers = {key: getattr(material, key, None) for key in _TEXTURES}
            textures = {key: images[number] for key, number in numbers.items() if number is not None}
            parts.append(Part(mesh, colors, material, textures))
    if not parts:
        raise ValueError(f"{path}: there is no mesh in it")
    return parts


def _shaded(
    points: NDArray[np.float64], faces: NDArray[np.integer[Any]], uvs: NDArray[np.float32] | None = None
) -> Mesh:
    """Makes a Mesh with smooth normals and a vertex for each triangle corner. Faces at a vertex share a normal if the
    angle between them is below CREASE_DEG: a cylinder's side is smooth and its rim sharp. points: [n, 3]. faces: [t,
    3]. uvs: [n, 2]."""
    _, same = np.unique(points, axis=0, return_inverse=True)
    joined = same.reshape(-1)[faces]
    edges = points[faces]
    area = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    unit = np.divide(area, length, out=np.zeros_like(area), where=length > 0.0)
    corners, count = joined.ravel(), len(joined)
    shape = len(corners), int(joined.max()) + 1
    corner_vertex = coo_matrix((np.ones(len(corners)), (np.arange(len(corners)), corners)), shape).tocsr()
    vertex_face = coo_matrix(
        (np.ones(len(corners)), (corners, np.repeat(np.arange(count), 3))), (shape[1], count)
    ).tocsr()
    pairs = (corner_vertex @ vertex_face).tocoo()
    alike = np.einsum("ij,ij->i", unit[pairs.row // 3], unit[pairs.col]) > np.cos(np.deg2rad(CREASE_DEG))
    near = coo_matrix((np.ones(alike.sum()), (pairs.row[alike], pairs.col[alike])), (len(corners), count)).tocsr()
    normals = near @ area
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(
        length > 0.0, normals / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0)
    )  # for corners of triangles without area
    at = faces.ravel()
    return Mesh.from_arrays(
        points[at], normals, np.zeros((len(at), 2)) if uvs is None else uvs[at], np.arange(len(at)).reshape(-1, 3)
    )


@cache
def _device() -> kuafu.Device:
    """Returns the device of the scenes that files are read into; it is made once."""
    return kuafu.Device()
