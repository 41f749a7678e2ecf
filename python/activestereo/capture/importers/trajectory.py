# SPDX-License-Identifier: Apache-2.0
"""Reads camera poses over time from a TUM text file: each line is timestamp tx ty tz qx qy qz qw, camera_to_world; #
starts a comment. Refuses other programs' files that people mistake for poses or calibrations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from activestereo.common.input_files import read_json_object, read_text

_TRANSFORMS = "transforms.json"


def refuse_foreign(path: Path) -> None:
    """Raises ValueError if a file, or a folder's transforms.json, is nerfstudio's, which is not supported."""
    path = path / _TRANSFORMS if path.is_dir() else path
    if path.suffix.lower() != ".json" or not path.is_file():
        return
    frames = read_json_object(path).get("frames")
    if isinstance(frames, list) and any(isinstance(frame, dict) and "transform_matrix" in frame for frame in frames):
        raise ValueError(
            f"{path}: is nerfstudio's transforms.json (instant-ngp's, too): lens and poses of one colour camera, no "
            "infrared pair: give a recording with left and right images, and --calibration of both cameras"
        )


def pose_of_seven(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """Returns the 4x4 of x, y, z, qx, qy, qz, qw, as TUM's and robots' files have them. Raises ValueError, which begins
    with the name, if the quaternion's length is more than 1 % off 1."""
    x, y, z, qx, qy, qz, qw = np.asarray(values, dtype=np.float64)
    norm = float(np.linalg.norm((qx, qy, qz, qw)))
    if abs(norm - 1.0) > 0.01:
        raise ValueError(f"{name}: the quaternion's length is {norm:.3f}, expected 1")
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = Rotation.from_quat((qx, qy, qz, qw)).as_matrix(), (x, y, z)
    return out


def read_trajectory(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reads (times [n] in seconds, increasing; camera_to_world [n, 4, 4]). Raises ValueError with file, line and
    fault."""
    refuse_foreign(path)
    times, poses = list[float](), list[NDArray[np.float64]]()
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise ValueError(f"{path}: line {number}: '{line.strip()}' is not eight numbers") from None
        if len(values) != 8 or not np.isfinite(values).all():
            raise ValueError(
                f"{path}: line {number}: {len(values)} numbers, expected finite timestamp tx ty tz qx qy qz qw"
            )
        poses.append(pose_of_seven(values[1:], f"{path}: line {number}"))
        if times and values[0] <= times[-1]:
            raise ValueError(f"{path}: line {number}: timestamp {values[0]:.6f} is not after {times[-1]:.6f}")
        times.append(values[0])
    if not poses:
        raise ValueError(f"{path}: holds no poses: each line is timestamp tx ty tz qx qy qz qw")
    return np.array(times), np.array(poses)


def pose_at(times: NDArray[np.float64], poses: NDArray[np.float64], time: float, name: str) -> NDArray[np.float64]:
    """Returns the 4x4 pose at a time, interpolated between its neighbours. Raises ValueError, which begins with `name`,
    if the time is more than 50 ms outside of `times`."""
    if not times[0] - 0.05 <= time <= times[-1] + 0.05:
        raise ValueError(f"{name}: its time {time:.6f} s is outside the poses' {times[0]:.6f} to {times[-1]:.6f} s")
    time = float(np.clip(time, times[0], times[-1]))
    if len(times) == 1:
        return poses[0]
    pose = np.eye(4)
    pose[:3, :3] = Slerp(times, Rotation.from_matrix(poses[:, :3, :3]))(time).as_matrix()
    pose[:3, 3] = [np.interp(time, times, poses[:, axis, 3]) for axis in range(3)]
    return pose
