# SPDX-License-Identifier: Apache-2.0
"""Writes the measured scene as a glTF file. Each view's surface is a mesh with its own albedo and room light; parts
that an earlier view contains are left out. Also makes masks of the parts of each image that the scene predicts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from activestereo.calibrate.world.light import Textures
from activestereo.calibrate.world.overlaps import Pose
from activestereo.calibrate.world.views import (
    Image,
    Mask,
    SceneView,
    near_edges,
    normals_of,
    pixel_grid,
    points_of,
    same_surface,
)
from activestereo.capture.capture import Camera, Capture, Rig
from activestereo.common import srgb
from activestereo.common.output_files import png_bytes
from activestereo.scene_io.gltf_writer import CLAMP, GltfWriter
from activestereo.scene_io.meshes import Mesh, depth_triangles

_MOST_TRIANGLES = 1_000_000
_JUMP = 0.03  # neighbours farther apart than this share of their depth belong to two surfaces
_SAME_SURFACE = 0.015
_MASK_EDGE_PX = 9
_SEAM_PX = 5  # views overlap by this width, so that no light falls between them
_BRIGHTEST_ALBEDO = 0.8
_IR_ALBEDO = 0.5  # of a surface with measured depth alone
_BRIGHT = 0.998  # this quantile of a texture is its brightest value


def write_scene(
    path: Path, views: Sequence[SceneView], poses: Sequence[Pose], textures: Sequence[Textures], camera: Camera
) -> int:
    """Writes a scene of several views as .glb and returns the number of triangles. poses: 4x4 camera_to_world. Each
    surface emits the room's light that it reflects, and this emission lights no other surface."""
    writer = GltfWriter("activestereo calibrate world")
    writer.set_extras(room_light="emission")
    step = int(np.ceil(np.sqrt(2.0 * len(views) * camera.width * camera.height / _MOST_TRIANGLES)))
    albedo_bright, room_bright = (
        max(float(np.quantile(np.stack([image[::4, ::4] for image in images]), _BRIGHT)), 1e-9)
        for images in ([t.albedo for t in textures], [t.room for t in textures])
    )
    albedo_scale, room_scale = _BRIGHTEST_ALBEDO / albedo_bright, 1.0 / room_bright
    triangles = 0
    for k, (view, pose, texture) in enumerate(zip(views, poses, textures, strict=True)):
        fresh = ~_already_seen(view, pose, views[:k], poses[:k], camera.K)
        # Smooth the depth's finest noise, and fill holes of a few pixels with the depth behind them.
        smooth = cv2.medianBlur(view.depth_m, 5)
        smooth = np.where(np.abs(smooth - view.depth_m) < _JUMP * view.depth_m, smooth, view.depth_m)
        depth = cv2.bilateralFilter(smooth.astype(np.float32), 5, 0.01, 2.0)
        for _ in range(3):
            depth = np.where(depth > 0, depth, cv2.dilate(depth, np.ones((3, 3), np.uint8)))
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


def _png(linear: Image) -> bytes:
    """Encodes a linear image 0..1 as an sRGB PNG, which keeps the relative error of dark values small."""
    counts = np.rint(255.0 * srgb.encoded(np.clip(linear, 0.0, 1.0))).astype(np.uint8)
    return png_bytes(np.repeat(counts[..., None], 3, axis=2))


def _already_seen(
    view: SceneView, pose: Pose, others: Sequence[SceneView], poses: Sequence[Pose], K: NDArray[np.float64]
) -> Mask:
    """Returns a mask of the view's pixels whose surface lies at the same depth in an earlier view. Near an earlier
    view's border no pixel is masked, so meshes overlap. others, poses: earlier views and their 4x4 camera_to_world;
    pose: the view's own."""
    points = points_of(view.depth_m, K)
    had = np.zeros(view.depth_m.shape, bool)
    for other, own in zip(others, poses, strict=True):
        column, row, same = same_surface(points, np.linalg.inv(own) @ pose, K, other.depth_m, _SAME_SURFACE)
        inner = cv2.erode(other.surface.astype(np.uint8), np.ones((_SEAM_PX, _SEAM_PX), np.uint8), borderValue=0)
        had |= same & (cv2.remap(inner, column, row, cv2.INTER_NEAREST) > 0)
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


def known_masks(
    views: Sequence[SceneView], poses: Sequence[Pose], is_train: Sequence[bool], rig: Rig
) -> dict[tuple[int, str], Mask]:
    """Returns {(frame id, side): mask [height, width]} of the known part of the scene in each image. Known are measured
    surfaces, far from edges, that a second training view has measured, too. A surface from a single view would only be
    compared with itself. is_train: whether each view is for training, not held out for the test."""
    out: dict[tuple[int, str], Mask] = {}
    for k, view in enumerate(views):
        known = (view.depth_m > 0) & ~near_edges(view.depth_m, _MASK_EDGE_PX)
        others = [j for j, used in enumerate(is_train) if used and j != k]
        elsewhere = np.full(known.shape, not others)
        for j in others:
            to_other = np.linalg.inv(poses[j]) @ poses[k]
            column, row, same = same_surface(
                points_of(view.depth_m, rig.left.K), to_other, rig.left.K, views[j].depth_m, _SAME_SURFACE
            )
            inside = cv2.remap(views[j].surface.astype(np.float32), column, row, cv2.INTER_LINEAR) > 0.99
            elsewhere |= inside & same
        known &= elsewhere
        out[view.frame.id, "left"] = known
        out[view.frame.id, "right"] = _warp_to_right(view, known, rig)
    return out


def _warp_to_right(view: SceneView, known: Mask, rig: Rig) -> Mask:
    """Warps a mask of the left image to the right image by the view's depth. Right pixels near surfaces outside the
    mask are left out."""
    column, row = pixel_grid(known.shape)
    disparity = rig.left.K[0, 0] * rig.baseline_m / np.maximum(view.depth_m, 1e-3)
    at = np.rint(column - disparity + rig.right.K[0, 2] - rig.left.K[0, 2]).astype(int)
    inside = (view.depth_m > 0) & (at >= 0) & (at < known.shape[1])
    hit, foreign = np.zeros(known.shape, np.uint8), np.zeros(known.shape, np.uint8)
    rows = row.astype(int)
    hit[rows[inside & known], at[inside & known]] = 1
    foreign[rows[inside & ~known], at[inside & ~known]] = 1
    square = np.ones((3, 3), np.uint8)
    return np.asarray((cv2.morphologyEx(hit, cv2.MORPH_CLOSE, square) > 0) & (cv2.dilate(foreign, square) == 0))


NOTE = (
    "warning: this scene is what the camera measured, errors included: what it saw wrongly (gloss, glass, edges) is "
    "truth in it, what it did not see is empty, one albedo holds for all, and depth simulated on it tells nothing of "
    "the device's own bias. Give geometry where you have it"
)


def write_height_field(path: Path, capture: Capture, frame_id: int | None, step_px: int) -> tuple[int, float, int]:
    """Writes a scene file with the camera and the surface, in world axes, that a frame measured (None: the first frame
    with depth). Depth is the median over all frames with that frame's pose. step_px: pixels between vertices. Returns
    (number of triangles, share of the image that is a surface, number of frames). Raises ValueError if the frame has no
    depth, or hardly any."""
    known = [f for f in capture.frames if f.depth_path is not None]
    with_depth = [f for f in known if frame_id in (None, f.id)]
    if not with_depth:
        which = "every frame" if frame_id is None else f"frames[id={frame_id}] is not there or"
        raise ValueError(f"{capture.path}: {which} has no depth: record the depth stream, too")
    pose = with_depth[0].camera_to_world
    repeats = [f for f in known if np.allclose(f.camera_to_world, pose, atol=1e-9)]
    # The median of each pixel's measured values; 0 where fewer than half of the frames have one.
    stack = np.array([capture.depth(frame) for frame in repeats], dtype=np.float32)
    often = (stack > 0).sum(axis=0) * 2 > len(repeats)
    depth = np.zeros(stack.shape[1:], np.float32)
    depth[often] = np.nanmedian(np.where(stack > 0, stack, np.nan)[:, often], axis=0)
    smooth = cv2.medianBlur(depth, 5)
    depth = np.where((depth > 0) & (np.abs(smooth - depth) < _JUMP * depth), smooth, depth)
    solid = depth[tuple(distance_transform_edt(depth == 0, return_distances=False, return_indices=True))]
    mesh = surface_mesh(depth, solid, depth > 0, capture.rig.left.K, pose, step_px)
    count = 0 if mesh is None else len(mesh.indices)
    height, width = (-(-side // step_px) - 1 for side in depth.shape)
    share = count / max(2.0 * height * width, 1.0)
    if mesh is None or share < 0.01:
        told = f"{100 * share:.2f} % of it is a surface: it has too few measured pixels"
        raise ValueError(f"{with_depth[0].depth_path}: {told}")
    writer = GltfWriter("activestereo calibrate scene")
    gray = {"baseColorFactor": [_IR_ALBEDO] * 3 + [1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    material = writer.add_material(
        "measured surface", pbrMetallicRoughness=gray, doubleSided=True, extras={"ir_albedo": _IR_ALBEDO},
        extensions={"KHR_materials_specular": {"specularFactor": 0.0}},
    )  # fmt: skip
    writer.add_placed_mesh("measured surface", mesh, material, np.eye(4))
    add_camera(writer, "camera", pose, capture.rig.left)
    writer.write(path)
    return count, share, len(repeats)
