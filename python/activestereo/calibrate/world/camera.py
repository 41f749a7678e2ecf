# SPDX-License-Identifier: Apache-2.0
"""Estimates focal length and centre. Overlapping views give them, since surfaces agree only under the true values; else
a chessboard of any size that stands in the views, with the projector on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from activestereo.calibrate.world.views import SceneView
from activestereo.capture.capture import Rig

Vector = NDArray[np.float64]

# Standard deviations that weigh the board's residuals: corners, and depth at a corner as a share of it.
_CORNER_PX, _DEPTH_SHARE = 0.1, 2e-3
_LEAST_BOARDS = 4
_MOST_MISFIT_PX = 1.0
# Scenes of one camera agree to this, px. Common errors of depth are in no scene's own interval.
_SCENE_PX = 0.4
# A scene with a larger deviation than this, px, does not determine the camera.
_MOST_DEVIATION_PX = 6.0
_Z90 = 1.645


@dataclass(frozen=True)
class CameraEstimate:
    """The estimated intrinsics. mean: (focal length, centre's column, centre's row), px. covariance: [3, 3]. source:
    'overlaps', 'board' or 'nominal'. text: a line for the user."""

    mean: Vector
    covariance: NDArray[np.float64]
    source: str
    text: str

    @property
    def K(self) -> NDArray[np.float64]:
        f, cx, cy = self.mean
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class _Board:
    frame: int
    shape: tuple[int, int]
    corners: Vector
    depth_m: Vector


def camera_from_boards(views: Sequence[SceneView], rig: Rig) -> CameraEstimate | None:
    """Estimates the camera from a chessboard in the views; None if fewer than four views show it."""
    found = [board for view in views if (board := _board(view)) is not None]
    boards = _drop_outliers(found)
    if len(boards) < _LEAST_BOARDS:
        return None
    start = _start(boards, rig)
    solved = least_squares(_residuals, start, args=(boards,), loss="soft_l1", x_scale="jac", method="trf")
    covariance = _clustered(solved, boards)[:3, :3]
    f, cx, cy = solved.x[:3]
    return CameraEstimate(
        solved.x[:3], covariance, "board", _text(solved.x, covariance, f"a board in {len(boards)} views")
    )


def camera_from_overlaps(scenes: Sequence[tuple[Vector, NDArray[np.float64]]]) -> CameraEstimate | None:
    """Combines the (mean, covariance) that each scene's overlapping views give to one estimate; None if no scene
    determines the camera. Scenes that differ by more than their intervals widen the result (Birge 1932)."""
    told = [(m, c) for m, c in scenes if np.sqrt(np.diag(c)).max() < _MOST_DEVIATION_PX]
    if not told:
        return None
    weights = [np.linalg.inv(c + _SCENE_PX**2 * np.eye(3)) for _, c in told]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    mean = covariance @ np.sum([w @ m for w, (m, _) in zip(weights, told, strict=True)], axis=0)
    misfit = sum(float((m - mean) @ w @ (m - mean)) for w, (m, _) in zip(weights, told, strict=True))
    covariance *= max(1.0, misfit / max(3 * (len(told) - 1), 1))
    source = f"overlaps of views in {len(told)} scene{'s' * (len(told) > 1)}"
    return CameraEstimate(mean, covariance, "overlaps", _text(mean, covariance, source))


def _text(mean: Vector, covariance: NDArray[np.float64], source: str) -> str:
    f, cx, cy = mean[:3]
    sd = _Z90 * np.sqrt(np.diag(covariance))
    return (
        f"camera: f {f:.1f} +- {sd[0]:.1f} px, centre ({cx:.1f} +- {sd[1]:.1f}, {cy:.1f} +- {sd[2]:.1f}) px, from "
        f"{source} (90 %)"
    )


def _board(view: SceneView) -> _Board | None:
    image = np.clip(view.left * (255.0 / max(255.0, float(view.left.max()))), 0, 255).astype(np.uint8)
    image = cv2.createCLAHE(3.0, (8, 8)).apply(cv2.GaussianBlur(image, (0, 0), 1.0))  # dots are finer than squares
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE
    is_found, corners, meta = cv2.findChessboardCornersSBWithMeta(image, (5, 5), flags)
    if not is_found:
        return None
    corners = corners.reshape(-1, 2).astype(np.float64)
    column, row = np.rint(corners).astype(int).T
    around = [view.depth_m[max(r - 2, 0) : r + 3, max(c - 2, 0) : c + 3] for c, r in zip(column, row, strict=True)]
    depth = np.array([np.median(patch[patch > 0]) if (patch > 0).any() else np.nan for patch in around])
    return _Board(view.frame.id, meta.shape, corners, depth)


def _grid(shape: tuple[int, int]) -> Vector:
    row, column = np.mgrid[0 : shape[0], 0 : shape[1]]
    return np.stack([column.ravel(), row.ravel(), 0.0 * row.ravel()], axis=-1).astype(np.float64)


def _start(boards: Sequence[_Board], rig: Rig) -> Vector:
    """Returns the start of the fit as one vector: f, cx, cy, the square's side in metres, then each board's rotation
    vector and translation, in squares."""
    poses, squares = [], []
    for board in boards:
        _, turn, place = cv2.solvePnP(_grid(board.shape), board.corners, rig.left.K, None)
        poses += [*turn.ravel(), *place.ravel()]
        z = _in_camera(board, np.concatenate([turn.ravel(), place.ravel()]))[:, 2]
        squares.append(np.nanmedian(board.depth_m / z))
    K = rig.left.K
    return np.array([K[0, 0], K[0, 2], K[1, 2], float(np.median(squares)), *poses])


def _in_camera(board: _Board, pose: Vector) -> Vector:
    return np.asarray(_grid(board.shape) @ cv2.Rodrigues(pose[:3])[0].T + pose[3:])


def _residuals(x: Vector, boards: Sequence[_Board]) -> Vector:
    f, cx, cy, square = x[:4]
    out = []
    for k, board in enumerate(boards):
        p = _in_camera(board, x[4 + 6 * k : 10 + 6 * k])
        seen = f * p[:, :2] / p[:, 2:] + (cx, cy)
        depth = np.nan_to_num((square * p[:, 2] / board.depth_m - 1.0) / _DEPTH_SHARE)
        out += [((seen - board.corners) / _CORNER_PX).ravel(), depth]
    return np.concatenate(out)


def _drop_outliers(boards: Sequence[_Board]) -> list[_Board]:
    """Returns the boards without those whose corners were miscounted: they do not fit the perspective of a plane."""
    kept = []
    for board in boards:
        homography, _ = cv2.findHomography(_grid(board.shape)[:, :2], board.corners)
        there = cv2.perspectiveTransform(_grid(board.shape)[None, :, :2], homography)[0]
        if np.sqrt(((there - board.corners) ** 2).sum(axis=1).mean()) < _MOST_MISFIT_PX:
            kept.append(board)
    return kept


def _clustered(solved: Any, boards: Sequence[_Board]) -> NDArray[np.float64]:
    """Computes the covariance by the sandwich over boards (Liang and Zeger 1986), since errors on one board are
    correlated."""
    jacobian, residual = solved.jac, solved.fun / np.sqrt(1.0 + solved.fun**2)
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    meat, first = np.zeros_like(inverse), 0
    for board in boards:
        own = slice(first, first := first + 3 * len(board.corners))
        gradient = jacobian[own].T @ residual[own]
        meat += np.outer(gradient, gradient)
    count = len(boards)
    return np.asarray(inverse @ meat @ inverse * (count / max(count - 1, 1)))
