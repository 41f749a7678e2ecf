# SPDX-License-Identifier: Apache-2.0
"""The place of a camera on a robot's gripper: OpenCV's five closed-form methods side by side, then the least squares of
all board poses.

gripper_to_base_i  camera_to_gripper  board_to_camera_i = board_to_base, for every frame i.
"""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from activestereo.common.input_files import read_text
from activestereo.common.pose import printed_motion

METHODS = {
    "Tsai": cv2.CALIB_HAND_EYE_TSAI,
    "Park": cv2.CALIB_HAND_EYE_PARK,
    "Horaud": cv2.CALIB_HAND_EYE_HORAUD,
    "Andreff": cv2.CALIB_HAND_EYE_ANDREFF,
    "Daniilidis": cv2.CALIB_HAND_EYE_DANIILIDIS,
}
LEAST_POSES = 5
# The robot must turn about two axes at least this far apart, and by this much, degrees.
_LEAST_TURN_DEG = 10.0
_INTERVAL_90 = 1.6449
# How far a rotation of 1 radian moves a board: what makes radians and metres comparable.
_LEVER_M = 0.5


@dataclass(frozen=True)
class HandEye:
    """camera_to_gripper, board_to_base: 4x4. by_method: camera_to_gripper of each closed form. error: standard
    deviations of the turn (3, radians) and the translation (3, metres). spread: largest distance of a method from the
    answer, metres and degrees. residual_m, residual_deg: RMS distance between the boards' places."""

    camera_to_gripper: NDArray[np.float64]
    board_to_base: NDArray[np.float64]
    by_method: dict[str, NDArray[np.float64]]
    error: NDArray[np.float64]
    spread: tuple[float, float]
    residual_m: float
    residual_deg: float
    poses: int

    def as_json(self) -> dict[str, object]:
        flat = {name: pose.ravel().tolist() for name, pose in self.by_method.items()}
        return {
            "camera_to_gripper": self.camera_to_gripper.ravel().tolist(),
            "board_to_base": self.board_to_base.ravel().tolist(), "by_method": flat,
            "turn_error_rad": self.error[:3].tolist(), "translation_error_m": self.error[3:].tolist(),
            "poses": self.poses,
            "residual_m": self.residual_m, "residual_deg": self.residual_deg,
        }  # fmt: skip

    def summary(self) -> str:
        """The summary that the command prints."""
        t, e = 1e3 * self.camera_to_gripper[:3, 3], 1e3 * _INTERVAL_90 * self.error[3:]
        turn = np.rad2deg(_INTERVAL_90 * np.linalg.norm(self.error[:3]))
        lines = [
            f"camera on gripper: {t[0]:.2f} ± {e[0]:.2f}, {t[1]:.2f} ± {e[1]:.2f}, {t[2]:.2f} ± {e[2]:.2f} mm, turn ± "
            f"{turn:.3f} deg (90 %), of {self.poses} poses"
        ]
        lines.append(f"boards' places agree to {1e3 * self.residual_m:.2f} mm, {self.residual_deg:.3f} deg RMS")
        for name, pose in self.by_method.items():
            metres, degrees = difference(pose, self.camera_to_gripper)
            lines.append(f"  {name:11} {1e3 * metres:7.2f} mm {degrees:7.3f} deg from it")
        return "\n".join(lines)


def hand_eye(gripper_to_base: list[NDArray[np.float64]], board_to_camera: list[NDArray[np.float64]]) -> HandEye:
    """The HandEye of frames with both. ValueError for fewer than 5, or where the robot did not turn about two axes."""
    count = len(gripper_to_base)
    if count < LEAST_POSES:
        raise ValueError(f"{count} frames have a robot's pose and a board, at least {LEAST_POSES} are needed")
    _check_turns(gripper_to_base)
    arguments = [
        [p[:3, :3] for p in gripper_to_base],
        [p[:3, 3] for p in gripper_to_base],
        [p[:3, :3] for p in board_to_camera],
        [p[:3, 3] for p in board_to_camera],
    ]
    by_method = {}
    for name, method in METHODS.items():
        rotation, translation = cv2.calibrateHandEye(*arguments, method=method)
        if np.isfinite(rotation).all() and np.isfinite(translation).all():
            by_method[name] = _matrix(Rotation.from_matrix(rotation).as_rotvec(), np.ravel(translation))
    start = by_method["Park"]
    board = gripper_to_base[0] @ start @ board_to_camera[0]

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        camera, base = _matrix(x[:3], x[3:6]), _matrix(x[6:9], x[9:])
        out = []
        for gripper, seen in zip(gripper_to_base, board_to_camera, strict=True):
            off = np.linalg.inv(base) @ gripper @ camera @ seen
            out += [_LEVER_M * Rotation.from_matrix(off[:3, :3]).as_rotvec(), off[:3, 3]]
        return np.concatenate(out)

    first = np.concatenate([_vector(start), _vector(board)])
    solution = least_squares(
        residuals,
        first,
        x_scale="jac",
        loss="soft_l1",
        f_scale=3.0 * max(float(np.median(np.abs(residuals(first)))), 1e-6),
    )
    left = residuals(solution.x).reshape(count, 6)
    variance = float((left**2).sum()) / max(6 * count - 12, 1)
    error = np.sqrt(variance * np.diag(np.linalg.pinv(solution.jac.T @ solution.jac, hermitian=True)))[:6]
    camera = _matrix(solution.x[:3], solution.x[3:6])
    apart = [difference(pose, camera) for pose in by_method.values()]
    return HandEye(
        camera, _matrix(solution.x[6:9], solution.x[9:]), by_method, error,
        (max(a[0] for a in apart), max(a[1] for a in apart)),
        float(np.sqrt((left[:, 3:] ** 2).sum(axis=1).mean())),
        float(np.rad2deg(np.sqrt((left[:, :3] ** 2).sum(axis=1).mean()) / _LEVER_M)), count,
    )  # fmt: skip


def difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[float, float]:
    """(metres, degrees) between two poses."""
    turn = np.linalg.norm(Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).as_rotvec())
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.rad2deg(turn))


def _check_turns(gripper_to_base: list[NDArray[np.float64]]) -> None:
    first = gripper_to_base[0][:3, :3]
    turns = np.array([Rotation.from_matrix(first.T @ pose[:3, :3]).as_rotvec() for pose in gripper_to_base])
    second = np.rad2deg(np.linalg.svd(turns, compute_uv=False)[1] / np.sqrt(max(len(turns) - 1, 1)))
    if second < 0.3 * _LEAST_TURN_DEG:
        raise ValueError(
            f"the robot turned about one axis only (about a second one by {second:.1f} deg): turn the gripper by "
            f"{_LEAST_TURN_DEG:g} deg and more about two axes"
        )


def read_poses(path: Path) -> dict[str, NDArray[np.float64]]:
    """{frame's name: gripper_to_base} of a CSV file: name,x,y,z,qx,qy,qz,qw (metres, unit quaternion), or name and 16
    numbers, row-major.

    A first line of words is a heading. ValueError names file, line and what is wrong.
    """
    poses = {}
    for number, row in enumerate(csv.reader(io.StringIO(read_text(path), newline="")), 1):
        cells = [cell.strip() for cell in row]
        if not any(cells) or (number == 1 and len(cells) > 1 and not _is_number(cells[1])):
            continue
        try:
            values = np.array([float(cell) for cell in cells[1:]])
        except ValueError:
            raise ValueError(f"{path}: line {number}: '{','.join(cells[1:])}' are not numbers") from None
        if len(values) not in (7, 16) or not np.isfinite(values).all():
            raise ValueError(
                f"{path}: line {number}: {len(values)} numbers, expected finite x,y,z,qx,qy,qz,qw or a row-major "
                "4x4"
            )
        poses[cells[0]] = _parse_pose(values, path, number)
    if not poses:
        raise ValueError(f"{path}: holds no poses: each line is name,x,y,z,qx,qy,qz,qw")
    return poses


def _parse_pose(values: NDArray[np.float64], path: Path, number: int) -> NDArray[np.float64]:
    if len(values) == 7:
        norm = float(np.linalg.norm(values[3:]))
        if abs(norm - 1.0) > 0.01:
            raise ValueError(f"{path}: line {number}: the quaternion's length is {norm:.3f}, expected 1")
        return _matrix(Rotation.from_quat(values[3:]).as_rotvec(), values[:3])
    pose = values.reshape(4, 4)
    return printed_motion(pose[:3, :3], pose[:3, 3], f"{path}: line {number}", pose[3])


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _matrix(turn: NDArray[np.float64], translation: NDArray[np.float64]) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), translation
    return pose


def _vector(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([Rotation.from_matrix(pose[:3, :3]).as_rotvec(), pose[:3, 3]])
