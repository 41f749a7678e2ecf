# SPDX-License-Identifier: Apache-2.0
"""Writes the measured scene as a glTF file. Each view's surface is a mesh with its own albedo and room light, without
the parts that an earlier view has."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from activestereo.calibrate.world.light import Textures
from activestereo.calibrate.world.overlaps import Pose
from activestereo.calibrate.world.views import Image, Mask, SceneView, normals_of, places_of, points_of
from activestereo.capture.capture import Camera
from activestereo.common import srgb
from activestereo.scene_io.gltf_writer import CLAMP, GltfWriter
from activestereo.scene_io.meshes import Mesh, depth_triangles

_MOST_TRIANGLES = 1_000_000
_JUMP = 0.03  # neighbours farther apart than this share of their depth belong to two surfaces
_SAME_SURFACE = 0.015
_SEAM_PX = 5  # views overlap by this width, so that no light falls between them
_BRIGHTEST_ALBEDO = 0.8
_BRIGHT = 0.998  # this quantile of a texture is its brightest value


def write_scene(
    path: Path, views: Sequence[SceneView], poses: Sequence[Pose], textures: Sequence[Textures], camera: Camera
) -> int:
    """Writes a scene of several views as .glb and returns the number of triangles. The world is the frame that the
    poses lead to. The materials' emission is the room's light reflected by each surface; it lights nothing else."""
    writer = GltfWriter("activestereo calibrate world")
    writer.set_extras(room_light="emission")
    step = int(np.ceil(np.sqrt(2.0 * len(views) * camera.width * camera.height / _MOST_TRIANGLES)))
    albedo_scale = _BRIGHTEST_ALBEDO / _brightest([t.albedo for t in textures])
    room_scale = 1.0 / _brightest([t.room for t in textures])
    triangles = 0
    for k, (view, pose, texture) in enumerate(zip(views, poses, textures, strict=True)):
        fresh = ~_already_seen(view, pose, views[:k], poses[:k], camera.K)
        depth = closed_depth(view.depth_m)
        mesh = surface_mesh(depth, depth, fresh, camera.K, pose, max(step, 2))
        if mesh is None:
            continue
        name, clamp = f"view {view.frame.id}", (CLAMP, CLAMP)
        albedo = writer.add_texture(_png(albedo_scale * texture.albedo), name, clamp)
        room = writer.add_texture(_png(room_scale * texture.room), f"{name}: room light", clamp)
        matt = {"baseColorTexture": {"index": albedo}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
        material = writer.add_material(
            name, pbrMetallicRoughness=matt, emissiveTexture={"index": room}, emissiveFactor=[1.0, 1.0, 1.0],
            doubleSided=True, extensions={"KHR_materials_specular": {"specularFactor": 0.0}},
        )  # fmt: skip
        writer.add_placed_mesh(name, mesh, material, np.eye(4))
        triangles += len(mesh.indices.reshape(-1, 3))
    add_camera(writer, "first view", poses[0], camera)
    writer.write(path)
    return triangles


def _brightest(images: Sequence[Image]) -> float:
    return max(float(np.quantile(np.stack([image[::4, ::4] for image in images]), _BRIGHT)), 1e-9)


def _png(linear: Image) -> bytes:
    """Encodes a linear image 0..1 as an sRGB PNG, which keeps the relative error of dark values small."""
    counts = np.rint(255.0 * srgb.encoded(np.clip(linear, 0.0, 1.0))).astype(np.uint8)
    buffer = BytesIO()
    Picture.fromarray(np.repeat(counts[..., None], 3, axis=2)).save(buffer, "PNG")
    return buffer.getvalue()


def closed_depth(depth_m: Image) -> Image:
    """Smooths the depth's finest noise and fills holes of a few pixels with the depth behind them."""
    smooth = cv2.medianBlur(depth_m, 5)
    smooth = np.where(np.abs(smooth - depth_m) < _JUMP * depth_m, smooth, depth_m).astype(np.float32)
    smooth = cv2.bilateralFilter(smooth, 5, 0.01, 2.0)
    for _ in range(3):
        behind = cv2.dilate(smooth, np.ones((3, 3), np.uint8))
        smooth = np.where(smooth > 0, smooth, behind)
    return np.asarray(smooth, np.float32)


def _already_seen(
    view: SceneView, pose: Pose, others: Sequence[SceneView], poses: Sequence[Pose], K: NDArray[np.float64]
) -> Mask:
    """Returns a mask of the view's pixels whose surface lies at the same depth in an earlier view. Near an earlier
    view's border no pixel is masked, so meshes overlap. others, poses: earlier views and their 4x4 camera_to_world;
    pose: the view's own."""
    points = points_of(view.depth_m, K)
    had = np.zeros(view.depth_m.shape, bool)
    for other, own in zip(others, poses, strict=True):
        column, row, z = places_of(points, np.linalg.inv(own) @ pose, K)
        inner = cv2.erode(other.surface.astype(np.uint8), np.ones((_SEAM_PX, _SEAM_PX), np.uint8), borderValue=0)
        seen = cv2.remap(inner, column, row, cv2.INTER_NEAREST) > 0
        depth = cv2.remap(other.depth_m, column, row, cv2.INTER_LINEAR)
        had |= seen & (z > 0.05) & (np.abs(depth - z) < _SAME_SURFACE * z)
    return had


def surface_mesh(
    depth: Image, solid: Image, wanted: Mask, K: NDArray[np.float64], pose: Pose, step: int
) -> Mesh | None:
    """Makes a mesh, in the world's frame, of a depth image's surface around the pixels of a mask; None if nothing is
    left. solid: the depth with its holes filled, for the normals. step: pixels between vertices."""
    row, column = np.mgrid[0 : depth.shape[0] : step, 0 : depth.shape[1] : step]
    triangles = depth_triangles(depth[row, column], _JUMP * step, wanted[row, column])
    if not len(triangles):
        return None
    used, triangles = np.unique(triangles, return_inverse=True)
    row, column = row.ravel()[used], column.ravel()[used]
    positions = points_of(depth, K)[row, column].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    normals = normals_of(points_of(solid, K))[row, column].astype(np.float64) @ pose[:3, :3].T
    uvs = np.stack([(column + 0.5) / depth.shape[1], (row + 0.5) / depth.shape[0]], axis=-1)
    return Mesh.from_arrays(positions, normals, uvs, triangles.reshape(-1, 3))


def add_camera(writer: GltfWriter, name: str, pose: Pose, camera: Camera) -> None:
    angle = 2.0 * float(np.arctan(0.5 * camera.height / camera.K[1, 1]))
    writer.add_camera(name, pose, angle, camera.width / camera.height)
