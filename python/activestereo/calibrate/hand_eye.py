# SPDX-License-Identifier: Apache-2.0
"""Measures a camera's pose on a robot's gripper: OpenCV's closed form (Park and Martin 1994), then least squares over
all board poses.

gripper_to_base_i  camera_to_gripper  board_to_camera_i = board_to_base, for every frame i."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from activestereo.calibrate.least_squares import INTERVAL_90, deviations, motion, vector
from activestereo.capture.importers.frames import pose_of_seven
from activestereo.common.input_files import read_text
from activestereo.common.pose import printed_motion, rigid_motion
from activestereo.common.shown import shown

_LEAST_POSES = 5
# The robot must turn about two axes at least this far apart, and by this much, degrees.
_LEAST_TURN_DEG = 10.0
# Distance by which a rotation of 1 radian moves a board; it makes radians and metres comparable.
_LEVER_M = 0.5


@dataclass(frozen=True)
class HandEye:
    """The camera's pose on the gripper. camera_to_gripper, board_to_base: 4x4. error: standard deviations of the
    rotation (3, radians) and the translation (3, metres). residual_m, residual_deg: RMS disagreement of the board's
    poses in the robot's base. poses: number of frames."""

    camera_to_gripper: NDArray[np.float64]
    board_to_base: NDArray[np.float64]
    error: NDArray[np.float64]
    residual_m: float
    residual_deg: float
    poses: int

    def as_json(self) -> dict[str, object]:
        return {
            "camera_to_gripper": self.camera_to_gripper.ravel().tolist(),
            "board_to_base": self.board_to_base.ravel().tolist(),
            "turn_error_rad": self.error[:3].tolist(), "translation_error_m": self.error[3:].tolist(),
            "poses": self.poses, "residual_m": self.residual_m, "residual_deg": self.residual_deg,
        }  # fmt: skip

    def summary(self) -> str:
        """Describes the pose as text, which the command prints."""
        t, e = 1e3 * self.camera_to_gripper[:3, 3], 1e3 * INTERVAL_90 * self.error[3:]
        turn = np.rad2deg(INTERVAL_90 * np.linalg.norm(self.error[:3]))
        place = ", ".join(f"{value:.2f} ± {half:.2f}" for value, half in zip(t, e, strict=True))
        agree = f"boards' places agree to {1e3 * self.residual_m:.2f} mm, {self.residual_deg:.3f} deg RMS"
        return f"camera on gripper: {place} mm, turn ± {turn:.3f} deg (90 %), of {self.poses} poses\n{agree}"


def hand_eye(gripper_to_base: list[NDArray[np.float64]], board_to_camera: list[NDArray[np.float64]]) -> HandEye:
    """Computes the HandEye from one 4x4 gripper_to_base and one 4x4 board_to_camera for each frame. Raises ValueError
    for fewer than 5 frames, or if the gripper did not turn about two axes."""
    count = len(gripper_to_base)
    if count < _LEAST_POSES:
        raise ValueError(f"{count} frames have a robot's pose and a board, at least {_LEAST_POSES} are needed")
    turns = np.array([vector(np.linalg.inv(gripper_to_base[0]) @ pose)[:3] for pose in gripper_to_base])
    second = np.rad2deg(np.linalg.svd(turns, compute_uv=False)[1] / np.sqrt(max(len(turns) - 1, 1)))
    if second < 0.3 * _LEAST_TURN_DEG:
        told = f"the robot turned about one axis only (about a second one by {second:.1f} deg)"
        raise ValueError(f"{told}: turn the gripper by {_LEAST_TURN_DEG:g} deg and more about two axes")
    parts = []
    for poses in (gripper_to_base, board_to_camera):
        parts += [[pose[:3, :3] for pose in poses], [pose[:3, 3] for pose in poses]]
    turn, place = cv2.calibrateHandEye(*parts, method=cv2.CALIB_HAND_EYE_PARK)
    start = rigid_motion(place.ravel(), turn)

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        camera, to_board = motion(x[:6]), np.linalg.inv(motion(x[6:]))
        off = [vector(to_board @ g @ camera @ seen) for g, seen in zip(gripper_to_base, board_to_camera, strict=True)]
        return np.asarray((np.array(off) * [*3 * [_LEVER_M], 1.0, 1.0, 1.0]).ravel())

    first = np.concatenate([vector(start), vector(gripper_to_base[0] @ start @ board_to_camera[0])])
    scale = 3.0 * max(float(np.median(np.abs(residuals(first)))), 1e-6)
    solution = least_squares(residuals, first, x_scale="jac", loss="soft_l1", f_scale=scale)
    rest = residuals(solution.x)
    turned, moved = np.sqrt((rest.reshape(count, 2, 3) ** 2).sum(axis=2).mean(axis=0)).tolist()
    return HandEye(
        motion(solution.x[:6]), motion(solution.x[6:]), deviations(solution, rest)[:6], moved,
        float(np.rad2deg(turned / _LEVER_M)), count,
    )  # fmt: skip


def read_poses(path: Path) -> dict[str, NDArray[np.float64]]:
    """Reads {frame's name without folder and suffix: gripper_to_base} from a CSV file. A line is
    name,x,y,z,qx,qy,qz,qw (metres, unit quaternion), or name and 16 numbers, row-major. A first line of words is a
    heading. Raises ValueError with file, line and fault."""
    poses, lines = {}, dict[str, int]()
    try:
        rows = list(csv.reader(io.StringIO(read_text(path), newline="")))
    except csv.Error as error:
        raise ValueError(f"{path}: is no table of poses: {error}") from error
    for number, row in enumerate(rows, 1):
        cells, place = [cell.strip() for cell in row], f"{path}: line {number}"
        if not any(cells):
            continue
        try:
            values = np.array([float(cell) for cell in cells[1:]])
        except ValueError:
            if number == 1 and cells[1][:1].isalpha():
                continue
            raise ValueError(f"{place}: '{','.join(cells[1:])}' are not numbers") from None
        if len(values) not in (7, 16) or not np.isfinite(values).all():
            raise ValueError(f"{place}: {len(values)} numbers, expected finite x,y,z,qx,qy,qz,qw or a row-major 4x4")
        name = Path(cells[0]).stem
        if (before := lines.setdefault(name, number)) != number:
            told = "keep one of them; folders and endings of names do not count"
            raise ValueError(f"{place}: frame {shown(cells[0])} has a pose in line {before}, too: {told}")
        if len(values) == 16:
            pose = values.reshape(4, 4)
            poses[name] = printed_motion(pose[:3, :3], pose[:3, 3], place, pose[3])
            continue
        poses[name] = pose_of_seven(values, place)
    if not poses:
        raise ValueError(f"{path}: holds no poses: each line is name,x,y,z,qx,qy,qz,qw")
    return poses
