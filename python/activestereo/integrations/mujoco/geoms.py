# SPDX-License-Identifier: Apache-2.0
"""The geoms of a MuJoCo model as meshes in the geom's own frame, with texture coordinates."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from activestereo.scene_io import solids
from activestereo.scene_io.meshes import Mesh

# Half the side of a plane that the model calls infinite, in extents of the model.
_ENDLESS_EXTENTS = 10.0
_CUBE_FACES = 6
# Texels of the next square are not to be blended in.
_INSIDE = 0.999


def geom_mesh(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """The geom's surface in metres; None for kinds without a body's surface."""
    kinds = mujoco.mjtGeom
    kind, size = kinds(int(model.geom_type[geom])), model.geom_size[geom]
    if kind == kinds.mjGEOM_PLANE:
        endless_m = _ENDLESS_EXTENTS * model.stat.extent
        return _scaled(solids.rectangle(), [s if s > 0 else endless_m for s in size[:2]] + [1.0])
    if kind == kinds.mjGEOM_BOX:
        return _scaled(solids.box(), size)
    if kind == kinds.mjGEOM_SPHERE:
        return _scaled(solids.sphere(), size[[0, 0, 0]])
    if kind == kinds.mjGEOM_ELLIPSOID:
        return _scaled(solids.sphere(), size)
    if kind == kinds.mjGEOM_CYLINDER:
        return _scaled(solids.cylinder(), size[[0, 0, 1]])
    if kind == kinds.mjGEOM_CAPSULE:
        return solids.capsule(float(size[0]), float(size[1]))
    if kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF) and model.geom_dataid[geom] >= 0:
        return _model_mesh(model, model.geom_dataid[geom])
    if kind == kinds.mjGEOM_HFIELD:
        return _height_field(model, model.geom_dataid[geom])
    return None


def has_own_uvs(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a geom's mesh came with texture coordinates."""
    mesh = model.geom_dataid[geom]
    kinds = mujoco.mjtGeom
    is_mesh = kinds(int(model.geom_type[geom])) in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF)
    return bool(is_mesh and mesh >= 0 and model.mesh_texcoordadr[mesh] >= 0)


def plane_uvs(mesh: Mesh, repeat: NDArray[np.float64], is_uniform: bool) -> Mesh:
    """Texture coordinates of a 2D texture over x and y, repeated `repeat` times over the geom, or per metre if it is
    uniform."""
    at = mesh.positions[:, :2] * [1.0, -1.0]
    half = 1.0 if is_uniform else 2.0 * np.abs(mesh.positions[:, :2]).max(axis=0).clip(1e-9)
    return replace(mesh, uvs=np.ascontiguousarray(at / half * repeat + 0.5 * (not is_uniform), np.float32))


def cube_uvs(mesh: Mesh, is_uniform: bool) -> Mesh:
    """Texture coordinates of a cube texture, seen from the geom's middle (OpenGL's rule for cube maps). Its six squares
    lie below one another (+x, -x, +y, -y, +z, -z). Each triangle takes the square of its own middle."""
    half = 1.0 if is_uniform else np.abs(mesh.positions).max(axis=0).clip(1e-9)
    corners = (mesh.positions / half)[mesh.indices].astype(np.float64)
    middle = corners.mean(axis=1)
    axis = np.abs(middle).argmax(axis=1)
    rows = np.arange(len(axis))
    sign = np.where(middle[rows, axis] < 0, -1.0, 1.0)
    x, y, z = np.moveaxis(corners, -1, 0)
    face, s = axis[:, None], sign[:, None]
    depth = np.choose(face, [abs(x), abs(y), abs(z)]).clip(1e-9)
    u = 0.5 + 0.5 * np.clip(np.choose(face, [-s * z, x, s * x]) / depth, -_INSIDE, _INSIDE)
    v = 0.5 + 0.5 * np.clip(np.choose(face, [-y, s * z, -y]) / depth, -_INSIDE, _INSIDE)
    square = 2 * axis + (sign < 0)
    uvs = np.stack([u, (square[:, None] + v) / _CUBE_FACES], axis=-1)
    return Mesh.of(
        mesh.positions[mesh.indices].reshape(-1, 3),
        mesh.normals[mesh.indices].reshape(-1, 3),
        uvs.reshape(-1, 2),
        np.arange(3 * len(axis)).reshape(-1, 3),
    )


def _scaled(mesh: Mesh, scale: NDArray[np.float64] | list[float]) -> Mesh:
    normals = mesh.normals / np.asarray(scale)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh.of(mesh.positions * np.asarray(scale), normals, mesh.uvs, mesh.indices)


def _model_mesh(model: mujoco.MjModel, mesh: int) -> Mesh:
    """MuJoCo numbers positions, normals and texture coordinates apart; here a vertex is one of each."""
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    vertex, normal = model.mesh_face[faces], model.mesh_facenormal[faces]
    has_uvs = model.mesh_texcoordadr[mesh] >= 0
    uv = model.mesh_facetexcoord[faces] if has_uvs else np.zeros_like(vertex)
    corners, number = np.unique(np.stack([vertex, normal, uv], -1).reshape(-1, 3), axis=0, return_inverse=True)
    positions = model.mesh_vert[model.mesh_vertadr[mesh] + corners[:, 0]]
    normals = model.mesh_normal[model.mesh_normaladr[mesh] + corners[:, 1]]
    uvs = np.zeros((len(corners), 2))
    if has_uvs:
        uvs = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + corners[:, 2]] * [1.0, -1.0] + [0.0, 1.0]
    return Mesh.of(positions, normals, uvs, number.reshape(-1, 3))


def _height_field(model: mujoco.MjModel, field: int) -> Mesh:
    rows, columns = model.hfield_nrow[field], model.hfield_ncol[field]
    data = model.hfield_data[model.hfield_adr[field] :][: rows * columns].reshape(rows, columns)
    half_x, half_y, height, _ = model.hfield_size[field]
    return solids.height_field(data.astype(np.float64) * height, half_x, half_y)
