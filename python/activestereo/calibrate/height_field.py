# SPDX-License-Identifier: Apache-2.0
"""Makes a scene from measured depth alone, for captures without geometry: the surface visible from one pose, as a
mesh."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from activestereo.calibrate.world.mesh import add_camera, surface_mesh
from activestereo.capture.capture import Capture
from activestereo.scene_io.gltf_writer import GltfWriter

NOTE = (
    "warning: this scene is what the camera measured, errors included: what it saw wrongly (gloss, glass, edges) is "
    "truth in it, what it did not see is empty, one albedo holds for all, and depth simulated on it tells nothing of "
    "the device's own bias. Give geometry where you have it"
)
_IR_ALBEDO = 0.5
# A value farther than this share of its depth from the median of its surroundings is no noise, but an edge.
_JUMP = 0.03


def write_height_field(path: Path, capture: Capture, frame_id: int | None, step_px: int) -> tuple[int, float, int]:
    """Writes a scene file with the surface, in world axes, that all frames at the pose of a frame measured (None: the
    first frame with depth), and the camera. step_px: pixels between its vertices. Returns (number of triangles, share
    of the image that is a surface, number of frames). Raises ValueError if no such frame has depth, or if hardly any of
    it is measured."""
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
