# SPDX-License-Identifier: Apache-2.0
"""Shared by the rig's tests: a stereo rig and a robot whose calibration is known, in front of a board."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from activestereo.calibrate.rig import Board, BoardView
from activestereo.common.pose import rigid_motion

BOARD = Board("chessboard", 9, 6, 0.03)
_CORNER_NOISE_PX = 0.08
# A robot arm repeats to some tenths of a millimetre.
_ROBOT_NOISE_M, _ROBOT_NOISE_RAD = 2e-4, 2e-4


def printed(board: Board, pixels_per_m: float, margin_m: float) -> np.ndarray:
    """The board as a picture to print, its first corner at margin_m (chessboard: plus one square) from the left top."""
    margin = round(pixels_per_m * margin_m)
    if board.kind != "chessboard":
        gap = 0.0 if board.kind == "charuco" else board.second_m
        step = board.camera_m + gap
        size = tuple(round(pixels_per_m * (n * step - gap + 2 * margin_m)) for n in (board.columns, board.rows))
        return board._aruco_board()[0].draw(size, marginSize=margin, borderBits=1)
    square = round(pixels_per_m * board.camera_m)
    row, column = np.mgrid[: square * (board.rows + 1), : square * (board.columns + 1)] // square
    return np.pad(np.where((row + column) % 2 == 0, 0, 255).astype(np.uint8), margin, constant_values=255)


def matrix(turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    return rigid_motion(place, Rotation.from_rotvec(turn).as_matrix())


def projected(points: np.ndarray, pose: np.ndarray, K: np.ndarray, lens: np.ndarray | None = None) -> np.ndarray:
    """Pixels of points under a pose [4][4] to the camera."""
    return cv2.projectPoints(points, cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], K, lens)[0].reshape(-1, 2)


@dataclass(frozen=True)
class RigWorld:
    """K, distortion: by camera; boards: {view's name: board_to_left}; views: corners with noise of 0.08 px."""

    size: tuple[int, int]
    K: dict[str, np.ndarray]
    distortion: dict[str, np.ndarray]
    left_to_right: np.ndarray
    boards: dict[str, np.ndarray]
    views: list[BoardView]
    camera_to_gripper: np.ndarray

    @classmethod
    def make(cls, seed: int, count: int = 20, has_lens: bool = True) -> "RigWorld":
        rng = np.random.default_rng(seed)
        size, K, distortion = (848, 480), {}, {}
        for side in ("left", "right"):
            f = 430.0 * (1 + 0.01 * rng.standard_normal())
            cx, ratio, cy = 424 + 4 * rng.standard_normal(), rng.standard_normal(), 239 + 4 * rng.standard_normal()
            K[side] = np.array([[f, 0, cx], [0, f * (1 + 0.001 * ratio), cy], [0, 0, 1]])
            lens = np.array([-0.05, 0.03, 5e-4, -3e-4, 0.0]) * (1 + 0.2 * rng.standard_normal(5))
            distortion[side] = lens if has_lens else np.zeros(5)
        turn, place = ([0.2, -0.3, 0.1], [-0.05, 2e-4, -1e-4]) if has_lens else (np.zeros(3), [-0.05, 0, 0])
        left_to_right = matrix(np.deg2rad(turn), np.array(place))
        boards, views = {}, []
        points = BOARD.chessboard_points()
        middle = points.mean(axis=0)
        while len(views) < count:
            turn = np.deg2rad(rng.uniform(-38, 38, 3)) * [1, 1, 2]
            depth = rng.uniform(0.35, 0.7)
            place = depth * np.array([*(rng.uniform(-0.62, 0.62, 2) * [1, 0.55]), 1.0])
            pose = matrix(turn, place)
            pose[:3, 3] -= pose[:3, :3] @ middle
            corners = {}
            for side in ("left", "right"):
                camera = pose if side == "left" else left_to_right @ pose
                pixels = projected(points, camera, K[side], distortion[side])
                if np.all(pixels > 6) and np.all(pixels < np.array(size) - 7):
                    corners[side] = points, pixels + _CORNER_NOISE_PX * rng.standard_normal(pixels.shape)
            if len(corners) == 2:
                name = f"{len(views):03d}.png"
                boards[name] = pose
                views.append(BoardView(name, corners))
        hand = matrix(np.deg2rad([3.0, -5.0, 92.0]), np.array([0.02, -0.07, 0.04]))
        return cls(size, K, distortion, left_to_right, boards, views, hand)

    def robot(self, seed: int) -> list[np.ndarray]:
        """gripper_to_base of every view, with the arm's own errors."""
        rng = np.random.default_rng(1000 + seed)
        board_to_base = matrix(np.deg2rad([175.0, 4.0, 30.0]), np.array([0.5, 0.1, 0.02]))
        poses = []
        for view in self.views:
            true = board_to_base @ np.linalg.inv(self.boards[view.name]) @ np.linalg.inv(self.camera_to_gripper)
            turn = _ROBOT_NOISE_RAD * rng.standard_normal(3)
            poses.append(true @ matrix(turn, _ROBOT_NOISE_M * rng.standard_normal(3)))
        return poses

    def rendered(
        self, name: str, side: str, board: Board, first_corner_m: np.ndarray, margin_m: float = 0.02
    ) -> np.ndarray:
        """A picture of a printed board in a view, 8-bit, without lens distortion: three by three samples a pixel.
        first_corner_m: of the board's origin from the print's left top, metres."""
        assert not np.any(self.distortion[side])
        density, fine = 8000.0, 3
        print_ = printed(board, density, margin_m)
        pose = self.boards[name] if side == "left" else self.left_to_right @ self.boards[name]
        # Print pixels to board metres to fine pixels.
        x, y = 0.5 / density - first_corner_m
        to_board = np.array([[1 / density, 0, x], [0, 1 / density, y], [0, 0, 1.0]])
        K = self.K[side].copy()
        grow = np.array([[fine, 0, 0.5 * (fine - 1)], [0, fine, 0.5 * (fine - 1)], [0, 0, 1.0]])
        H = grow @ K @ pose[:3, [0, 1, 3]] @ to_board
        # The print is finer than the picture: blurred by half a fine pixel's share of it first.
        scale = fine * K[0, 0] / (density * pose[2, 3])
        soft = cv2.GaussianBlur(print_, (0, 0), max(0.4 / scale, 0.3))
        width, height = self.size
        warped = cv2.warpPerspective(soft, H, (fine * width, fine * height), flags=cv2.INTER_LINEAR, borderValue=150)
        image = cv2.resize(warped, (width, height), interpolation=cv2.INTER_AREA).astype(float)
        rng = np.random.default_rng(int(name[:3]) + (100 if side == "right" else 0))
        return np.rint(20 + 0.7 * image + rng.normal(0, 1.0, image.shape)).clip(0, 255).astype(np.uint8)
