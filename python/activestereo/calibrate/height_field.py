# SPDX-License-Identifier: Apache-2.0
"""Makes a scene from measured depth alone, for captures without geometry: the surface visible from one pose, as a
mesh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from activestereo.capture.capture import Capture
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.meshes import Mesh, depth_triangles

NOTE = (
    "warning: this scene is what the camera measured, errors included: what it saw wrongly (gloss, glass, edges) is "
    "truth in it, what it did not see is empty, one albedo holds for all, and depth simulated on it tells nothing of "
    "the device's own bias. Give geometry where you have it"
)
# Neighbours farther apart than this share of their depth belong to two surfaces.
_JUMP = 0.03
_MEDIAN_PX = 5
_IR_ALBEDO = 0.5


@dataclass(frozen=True)
class HeightField:
    """A measured surface in world axes. camera_to_world: of the left camera that saw it. share: part of the depth image
    that it covers. frames: number of repeats whose median it is."""

    mesh: Mesh
    camera_to_world: NDArray[np.float64]
    share: float
    frames: int


def height_field(capture: Capture, frame_id: int | None, step_px: int) -> HeightField:
    """Makes the surface, in world axes, from all frames at the pose of a frame; None: the first frame with depth.
    step_px: pixels between its vertices. Raises ValueError if no such frame has depth, or if hardly any of it is
    measured."""
    known = [f for f in capture.frames if f.depth_path is not None]
    with_depth = [f for f in known if frame_id in (None, f.id)]
    if not with_depth:
        which = "every frame" if frame_id is None else f"frames[id={frame_id}] is not there or"
        raise ValueError(f"{capture.path}: {which} has no depth: record the depth stream, too")
    pose = with_depth[0].camera_to_world
    repeats = [f for f in known if np.allclose(f.camera_to_world, pose, atol=1e-9)]
    # 1. The median of each pixel's measured values; 0 where fewer than half of the frames have one.
    stack = np.array([capture.depth(frame) for frame in repeats], dtype=np.float64)
    often = (stack > 0).sum(axis=0) * 2 > len(repeats)
    depth = np.zeros(stack.shape[1:])
    depth[often] = np.nanmedian(np.where(stack > 0, stack, np.nan)[:, often], axis=0)
    smooth = median_filter(depth, _MEDIAN_PX)
    depth = np.where((depth > 0) & (np.abs(smooth - depth) < _JUMP * depth), smooth, depth)
    # 2. Triangles of neighbours that belong to one surface.
    v, u = np.mgrid[0 : depth.shape[0] : step_px, 0 : depth.shape[1] : step_px]
    z = depth[v, u]
    triangles = depth_triangles(z, _JUMP * step_px)
    share = len(triangles) / max(2.0 * (z.shape[0] - 1) * (z.shape[1] - 1), 1.0)
    if share < 0.01:
        told = f"{100 * share:.2f} % of it is a surface: it has too few measured pixels"
        raise ValueError(f"{with_depth[0].depth_path}: {told}")
    # 3. Points in the world, and normals as the sum of the triangles' areas around them.
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(capture.rig.left.K).T
    points = ((rays * z[..., None]) @ pose[:3, :3].T + pose[:3, 3]).reshape(-1, 3)
    corners = points[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((z.size, 3))
    for k in range(3):
        np.add.at(normals, triangles[:, k], area)
    used, triangles = np.unique(triangles, return_inverse=True)
    own = normals[used] / np.maximum(np.linalg.norm(normals[used], axis=1, keepdims=True), 1e-30)
    uvs = np.stack([u / depth.shape[1], v / depth.shape[0]], axis=-1).reshape(-1, 2)[used]
    mesh = Mesh.from_arrays(points[used], own, uvs, triangles.reshape(-1, 3))
    return HeightField(mesh, pose, float(share), len(repeats))


def write_height_field(path: Path, field: HeightField, capture: Capture) -> None:
    """Writes a scene file with the surface and the camera that measured it."""
    writer = GltfWriter("activestereo calibrate scene")
    gray = {"baseColorFactor": [_IR_ALBEDO] * 3 + [1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    material = writer.add_material(
        "measured surface", pbrMetallicRoughness=gray, doubleSided=True, extras={"ir_albedo": _IR_ALBEDO},
        extensions={"KHR_materials_specular": {"specularFactor": 0.0}},
    )  # fmt: skip
    writer.add_placed_mesh("measured surface", field.mesh, material, np.eye(4))
    camera = capture.rig.left
    angle = 2.0 * float(np.arctan(0.5 * camera.height / camera.K[1, 1]))
    writer.add_camera("camera", field.camera_to_world, angle, camera.width / camera.height)
    writer.write(path)
