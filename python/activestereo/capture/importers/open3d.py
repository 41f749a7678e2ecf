# SPDX-License-Identifier: Apache-2.0
"""Reads folders of Open3D's recorders: color/, depth/ and camera_intrinsic.json (K column by column). Camera poses are
in trajectory.log, or in trajectory.json, which Open3D's viewer saves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.importers.color_depth import (
    ColorDepthFrame,
    ColorDepthRecording,
    camera_matrix_of,
    image_files,
)
from activestereo.common.input_files import read_json_object, read_text
from activestereo.common.pose import printed_motion

INTRINSICS = ("camera_intrinsic.json", "intrinsic.json")
_TRAJECTORIES = ("trajectory.log", "scene/trajectory.log", "trajectory.json", "scene/trajectory.json")
_UNIT_M = 0.001
_RATE_HZ = 30.0


def read_open3d(
    folder: Path, K: NDArray[np.float64] | None = None, depth_scale: float | None = None
) -> ColorDepthRecording:
    """Reads a folder as a ColorDepthRecording. K and depth_scale override the folder's. Raises ValueError with file,
    key and value."""
    path = next(folder / name for name in INTRINSICS if (folder / name).is_file())
    intrinsics = read_json_object(path)
    if K is None:
        if "intrinsic_matrix" not in intrinsics:
            raise ValueError(f"{path}: intrinsic_matrix: is missing: give --k FX,FY,CX,CY")
        key, given = "intrinsic_matrix", intrinsics["intrinsic_matrix"]
        try:
            values = np.array(given, dtype=np.float64).reshape(3, 3).T
        except (TypeError, ValueError):
            raise ValueError(f"{path}: {key}: is {given!r}, expected nine numbers, column by column") from None
        K = camera_matrix_of(path, key, values)
    colors, depths = image_files(folder / "color"), image_files(folder / "depth")
    if not depths:
        raise ValueError(f"{folder / 'depth'}: holds no PNG files")
    poses = _poses(folder)
    if poses is not None and len(poses) != len(depths):
        raise ValueError(f"{folder}: the trajectory has {len(poses)} poses, depth/ {len(depths)} images")
    scale = depth_scale or (1.0 / float(intrinsics["depth_scale"]) if intrinsics.get("depth_scale") else _UNIT_M)
    frames = [
        ColorDepthFrame(number / _RATE_HZ, file, colors.get(name), scale, None if poses is None else poses[number])
        for number, (name, file) in enumerate(depths.items())
    ]
    return ColorDepthRecording(folder, "an Open3D folder", K, tuple(frames))


def _poses(folder: Path) -> list[NDArray[np.float64]] | None:
    path = next((folder / name for name in _TRAJECTORIES if (folder / name).is_file()), None)
    if path is None:
        return None
    blocks: list[Any]
    if path.suffix == ".log":
        rows = [line.split() for line in read_text(path).splitlines() if line.strip()]
        blocks = [rows[k + 1 : k + 5] for k in range(0, len(rows), 5)]
    else:
        # Column by column, and from the world to the camera.
        blocks = [np.reshape(entry["extrinsic"], (4, 4)).T for entry in read_json_object(path).get("parameters", [])]
    out = []
    for number, block in enumerate(blocks):
        try:
            pose = np.array(block, dtype=np.float64).reshape(4, 4)
        except ValueError:
            raise ValueError(f"{path}: pose {number}: is not a 4x4 of numbers") from None
        pose = printed_motion(pose[:3, :3], pose[:3, 3], f"{path}: pose {number}", pose[3])
        out.append(pose if path.suffix == ".log" else np.linalg.inv(pose))
    return out
