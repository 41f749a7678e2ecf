# SPDX-License-Identifier: Apache-2.0
"""The calibration of both infrared cameras from frames of a board: K, lenses, the place of the right camera, and every
board's pose; and the picture of where corners were seen.

OpenCV's calibrateCamera and stereoCalibrate (Zhang 2000) give the start; a bundle adjustment over everything gives the
answer and its covariance: J^T J over the variance of the residuals, times 1.1 for what is not Gaussian about
corners."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix

from activestereo.calibrate.boards import Board
from activestereo.capture.capture import SIDES, Camera
from activestereo.capture.images import read_gray
from activestereo.common.output_files import replace_file
from activestereo.common.palette import INK, MUTED
from activestereo.common.progress_bar import part_of
from activestereo.model import Rig, SensorModel

LEAST_BOARDS = 3
_FEW_BOARDS = 10
# A view whose corners lie so much worse than the others' is a false detection.
_OUTLIER = 5.0
_INTERVAL_90 = 1.6449
_COVERAGE_CELLS = (8, 6)
_INFLATION = 1.1


@dataclass(frozen=True)
class BoardView:
    """One frame pair: points [n][3] and pixels [n][2] by camera; a camera that does not see the board is absent."""

    name: str
    corners: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]


@dataclass(frozen=True)
class Calibration:
    """K, distortion: by camera. left_to_right: 4x4. board_to_left: {view's name: 4x4}. error: standard deviations of
    {side: fx, fy, cx, cy} and of left_to_right's translation. rms_px: of the residuals. coverage: share of the
    picture's cells that corners reach, by camera."""

    size: tuple[int, int]
    K: dict[str, NDArray[np.float64]]
    distortion: dict[str, NDArray[np.float64]]
    left_to_right: NDArray[np.float64]
    board_to_left: dict[str, NDArray[np.float64]]
    error: dict[str, NDArray[np.float64]]
    rms_px: float
    coverage: dict[str, float]
    views: tuple[BoardView, ...]
    bit_depth: int

    def model(self, left_to_projector: NDArray[np.float64] | None = None) -> SensorModel:
        """model.json's `rig`."""
        left, right = (Camera(*self.size, self.K[side], self.distortion[side]) for side in SIDES)
        errors = "; ".join(
            f"{side} f ± {_INTERVAL_90 * self.error[side][0]:.2g}, c ± {_INTERVAL_90 * self.error[side][2]:.2g} px"
            for side in SIDES
        )
        source = f"calibrate rig: {len(self.views)} boards, {self.rms_px:.3f} px RMS, 90 %: {errors}"
        return SensorModel(rig=Rig(left, right, self.left_to_right, left_to_projector, self.bit_depth, source=source))

    def interval(self, side: str, number: int) -> tuple[float, float]:
        """The 90 % interval of a camera's fx, fy, cx or cy (number 0..3)."""
        K, half = self.K[side], _INTERVAL_90 * self.error[side][number]
        value = (K[0, 0], K[1, 1], K[0, 2], K[1, 2])[number]
        return float(value - half), float(value + half)

    def summary(self) -> str:
        """The summary that the command prints."""
        lines = [f"{len(self.views)} boards, {self.rms_px:.3f} px RMS (values with 90 % intervals)"]
        for side in SIDES:
            K, half = self.K[side], _INTERVAL_90 * self.error[side]
            numbers = zip(("fx", "fy", "cx", "cy"), (K[0, 0], K[1, 1], K[0, 2], K[1, 2]), half, strict=True)
            words = ", ".join(f"{name} {value:.2f} ± {h:.2f}" for name, value, h in numbers)
            lens = ", ".join(f"{d:.4f}" for d in self.distortion[side])
            lines.append(
                f"{side}: {words} px; lens {lens}; corners reach {100 * self.coverage[side]:.0f} % of the picture"
            )
        t, e = 1e3 * self.left_to_right[:3, 3], 1e3 * _INTERVAL_90 * self.error["translation"]
        angle = np.rad2deg(np.linalg.norm(cv2.Rodrigues(self.left_to_right[:3, :3])[0]))
        lines.append(
            f"right camera: x {t[0]:.3f} ± {e[0]:.3f}, y {t[1]:.3f} ± {e[1]:.3f}, z {t[2]:.3f} ± {e[2]:.3f} mm, turned "
            f"{angle:.3f} deg"
        )
        if len(self.views) < _FEW_BOARDS:
            lines.append(
                f"only {len(self.views)} boards: 15 or more, tilted up to 40 deg and into every corner, halve the "
                "intervals"
            )
        return "\n".join(lines)


def calibrate_rig(
    path: Path, board: Board, has_lens: bool = True, known_K: NDArray[np.float64] | None = None,
    progress: Callable[[float], object] | None = None
) -> Calibration:  # fmt: skip
    """The Calibration from PATH/left/*.png and PATH/right/*.png, pairs by name.

    has_lens: fit five coefficients of distortion; else the images are rectified, and both lenses ideal. known_K: 3x3 of
    both cameras, held (a device's own). ValueError with file, number and remedy: no pairs, sizes that differ, fewer
    than 3 boards found.
    """
    tell = progress or (lambda fraction: None)
    views, size, bit_depth = find_boards(path, board, part_of(tell, 0.0, 0.7))
    result = calibrate(views, size, has_lens, known_K, bit_depth)
    tell(1.0)
    return result


def find_boards(
    path: Path, board: Board, tell: Callable[[float], object]
) -> tuple[list[BoardView], tuple[int, int], int]:
    """(views that show a board, (width, height), bit depth)."""
    folders = {side: Path(path) / side for side in SIDES}
    names = {side: {file.name for file in folder.glob("*.png")} for side, folder in folders.items()}
    both = sorted(names["left"] & names["right"])
    if not both:
        raise ValueError(
            f"{path}: no PNG file is in both left/ and right/: give a folder with frames of both cameras under equal "
            "names"
        )
    views: list[BoardView] = []
    size: tuple[int, int] | None = None
    depth = 8
    for number, name in enumerate(both):
        corners = {}
        for side in SIDES:
            image = read_gray(folders[side] / name, size, "board frame")
            size = (image.shape[1], image.shape[0])
            if image.dtype == np.uint16:
                depth = max(depth, int(image.max()).bit_length())
                image = (image.astype(np.float32) * (255.0 / max(int(image.max()), 1))).astype(np.uint8)
            found = board.find(image)
            if found is not None:
                corners[side] = found
        if corners:
            views.append(BoardView(name, corners))
        tell((number + 1) / len(both))
    seen = sum(len(view.corners) == 2 for view in views)
    if size is None or seen < LEAST_BOARDS:
        raise ValueError(
            f"{path}: {seen} of {len(both)} frame pairs show the board to both cameras, at least {LEAST_BOARDS} are "
            "needed: check --board, light the board evenly with the projector off, and keep all of a chessboard in "
            "view"
        )
    return views, size, depth


def calibrate(
    views: list[BoardView],
    size: tuple[int, int],
    has_lens: bool = True,
    known_K: NDArray[np.float64] | None = None,
    bit_depth: int = 8,
) -> Calibration:
    """The Calibration of boards' corners; false detections are left out once."""
    result = _calibrate(views, size, has_lens, known_K, bit_depth)
    worst = {view.name: rms for view, rms in zip(result[0].views, result[1], strict=True)}
    limit = _OUTLIER * float(np.median(list(worst.values())))
    good = [view for view in views if worst.get(view.name, 0.0) <= limit]
    if len(good) == len(views) or sum(len(v.corners) == 2 for v in good) < LEAST_BOARDS:
        return result[0]
    return _calibrate(good, size, has_lens, known_K, bit_depth)[0]


def _calibrate(
    views: list[BoardView], size: tuple[int, int], has_lens: bool, known_K: NDArray[np.float64] | None, bit_depth: int
) -> tuple[Calibration, NDArray[np.float64]]:
    start = _start(views, size, has_lens, known_K)
    views = [view for view in views if view.name in start.boards]
    problem = _Bundle(views, start, has_lens, known_K is not None)
    solution = least_squares(
        problem.residuals, problem.vector, jac_sparsity=problem.sparsity(), x_scale="jac", method="trf", max_nfev=60
    )
    left = problem.residuals(solution.x)
    freedom = max(len(left) - len(solution.x), 1)
    variance = float(left @ left) / freedom
    jacobian = solution.jac.toarray() if hasattr(solution.jac, "toarray") else solution.jac
    scale = np.linalg.norm(jacobian, axis=0) + 1e-12
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), hermitian=True) / np.outer(scale, scale)
    deviation = _INFLATION * np.sqrt(variance * np.diag(inverse))
    K, distortion, left_to_right, poses = problem.unpacked(solution.x)
    error = problem.errors(deviation)
    coverage = {side: _coverage([v.corners[side][1] for v in views if side in v.corners], size) for side in SIDES}
    boards = {view.name: pose for view, pose in zip(views, poses, strict=True)}
    result = Calibration(
        size,
        K,
        distortion,
        left_to_right,
        boards,
        error,
        float(np.sqrt(2.0 * np.mean(left**2))),
        coverage,
        tuple(views),
        bit_depth,
    )
    return result, problem.rms_by_view(left)


@dataclass(frozen=True)
class _Start:
    K: dict[str, NDArray[np.float64]]
    distortion: dict[str, NDArray[np.float64]]
    left_to_right: NDArray[np.float64]
    boards: dict[str, NDArray[np.float64]]


def _start(
    views: list[BoardView], size: tuple[int, int], has_lens: bool, known_K: NDArray[np.float64] | None
) -> _Start:
    """OpenCV's calibration of each camera, and board poses in the left camera."""
    K, distortion = {}, {}
    poses: dict[str, dict[str, NDArray[np.float64]]] = {}
    flags = 0 if has_lens else cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    for side in SIDES:
        seen = [view for view in views if side in view.corners]
        points = [view.corners[side][0].astype(np.float32) for view in seen]
        pixels = [view.corners[side][1].astype(np.float32) for view in seen]
        if known_K is None:
            _, K[side], lens, rotations, translations = cv2.calibrateCamera(
                points, pixels, size, None, None, flags=flags
            )
            distortion[side] = np.ravel(lens)[:5]
        else:
            K[side], distortion[side] = np.array(known_K, dtype=np.float64), np.zeros(5)
            solved = [cv2.solvePnP(p, q, K[side], distortion[side]) for p, q in zip(points, pixels, strict=True)]
            rotations, translations = [s[1] for s in solved], [s[2] for s in solved]
        poses[side] = {view.name: _pose(r, t) for view, r, t in zip(seen, rotations, translations, strict=True)}
    between = [
        poses["right"][name] @ np.linalg.inv(pose) for name, pose in poses["left"].items() if name in poses["right"]
    ]
    turn = np.median([np.ravel(cv2.Rodrigues(b[:3, :3])[0]) for b in between], axis=0)
    left_to_right = _pose(turn, np.median([b[:3, 3] for b in between], axis=0))
    boards = dict(poses["left"])
    for name, pose in poses["right"].items():
        boards.setdefault(name, np.linalg.inv(left_to_right) @ pose)
    return _Start(K, distortion, left_to_right, boards)


class _Bundle:
    """The vector of everything, and what it leaves in pixels: per camera fx, fy, cx, cy and the lens; left_to_right; a
    pose per board."""

    def __init__(self, views: list[BoardView], start: _Start, has_lens: bool, is_known: bool) -> None:
        self._views, self._has_lens, self._start, self._is_known = views, has_lens, start, is_known
        parts: list[NDArray[np.float64]] = []
        for side in SIDES if not is_known else ():
            K = start.K[side]
            parts.append(np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]]))
            parts += [start.distortion[side]] if has_lens else []
        self._side = (0 if is_known else 4) + (5 if has_lens and not is_known else 0)
        parts.append(_vector(start.left_to_right))
        parts += [_vector(start.boards[view.name]) for view in views]
        self.vector = np.concatenate(parts)

    def unpacked(
        self, x: NDArray[np.float64]
    ) -> tuple[
        dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]], NDArray[np.float64], list[NDArray[np.float64]]
    ]:
        K, distortion = dict(self._start.K), {side: np.zeros(5) for side in SIDES}
        for number, side in enumerate(SIDES if self._side else ()):
            part = x[number * self._side : (number + 1) * self._side]
            K[side] = np.array([[part[0], 0.0, part[2]], [0.0, part[1], part[3]], [0.0, 0.0, 1.0]])
            if self._has_lens:
                distortion[side] = part[4:9]
        rest = x[2 * self._side :].reshape(-1, 6)
        return K, distortion, _pose(rest[0, :3], rest[0, 3:]), [_pose(p[:3], p[3:]) for p in rest[1:]]

    def residuals(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        K, distortion, left_to_right, poses = self.unpacked(x)
        out = []
        for view, pose in zip(self._views, poses, strict=True):
            for side, (points, pixels) in view.corners.items():
                camera = pose if side == "left" else left_to_right @ pose
                turn = cv2.Rodrigues(camera[:3, :3])[0]
                out.append(
                    (
                        cv2.projectPoints(points, turn, camera[:3, 3], K[side], distortion[side])[0].reshape(-1, 2)
                        - pixels
                    ).ravel()
                )
        return np.concatenate(out)

    def sparsity(self) -> lil_matrix:
        """The sparsity of the Jacobian: 1 where a residual depends on a parameter."""
        rows = sum(2 * len(pixels) for view in self._views for _, pixels in view.corners.values())
        pattern, row = lil_matrix((rows, len(self.vector)), dtype=int), 0
        for number, view in enumerate(self._views):
            pose = 2 * self._side + 6 * (number + 1)
            for side, (_, pixels) in view.corners.items():
                end = row + 2 * len(pixels)
                first = SIDES.index(side) * self._side
                pattern[row:end, first : first + self._side] = 1
                pattern[row:end, pose : pose + 6] = 1
                if side == "right":
                    pattern[row:end, 2 * self._side : 2 * self._side + 6] = 1
                row = end
        return pattern

    def errors(self, deviation: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        sides = {
            side: deviation[n * self._side : n * self._side + 4] if self._side else np.zeros(4)
            for n, side in enumerate(SIDES)
        }
        return sides | {"translation": deviation[2 * self._side + 3 : 2 * self._side + 6]}

    def rms_by_view(self, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
        out, row = [], 0
        for view in self._views:
            count = sum(2 * len(pixels) for _, pixels in view.corners.values())
            out.append(np.sqrt(2.0 * np.mean(residuals[row : row + count] ** 2)))
            row += count
        return np.array(out)


def _coverage(pixels: list[NDArray[np.float64]], size: tuple[int, int]) -> float:
    cells = np.concatenate(pixels) / np.array(size) * np.array(_COVERAGE_CELLS)
    inside = np.clip(cells.astype(int), 0, np.array(_COVERAGE_CELLS) - 1)
    return len(np.unique(inside, axis=0)) / float(np.prod(_COVERAGE_CELLS))


def _pose(turn: NDArray[np.float64], translation: NDArray[np.float64]) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(np.ravel(turn).astype(np.float64))[0], np.ravel(translation)
    return pose


def _vector(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([np.ravel(cv2.Rodrigues(pose[:3, :3])[0]), pose[:3, 3]])


def write_coverage(path: Path, result: Calibration) -> None:
    """Writes a PNG."""
    figure = coverage_figure(result)
    replace_file(path, lambda file: figure.savefig(file, format="png", dpi=110))


def coverage_figure(result: Calibration) -> Figure:
    """A matplotlib Figure: each camera's corners, coloured by what the calibration leaves of them, pixels."""
    figure = Figure(figsize=(11.0, 4.1), facecolor="white", layout="constrained")
    width, height = result.size
    shown = None
    for axes, side in zip(figure.subplots(1, 2), SIDES, strict=True):
        places, lengths = corner_errors(result, side)
        shown = axes.scatter(*places.T, c=lengths, s=7, cmap="viridis", vmin=0.0, vmax=max(4.0 * result.rms_px, 1e-3))
        axes.set(xlim=(0, width), ylim=(height, 0), aspect="equal")
        axes.set_title(
            f"{side}: {len(places)} corners reach {100 * result.coverage[side]:.0f} % of the picture",
            size=10,
            color=INK,
            loc="left",
        )
        axes.tick_params(labelsize=8, colors=MUTED)
    figure.colorbar(shown, ax=figure.axes, shrink=0.8).set_label("left over, px", size=9, color=MUTED)
    return figure


def corner_errors(result: Calibration, side: str) -> tuple[np.ndarray, np.ndarray]:
    """(pixels [n][2] of all corners of a camera, how far off each is)."""
    places, lengths = [], []
    for view in result.views:
        if side in view.corners:
            points, pixels = view.corners[side]
            pose = (
                result.board_to_left[view.name]
                if side == "left"
                else result.left_to_right @ result.board_to_left[view.name]
            )
            turn = cv2.Rodrigues(pose[:3, :3])[0]
            drawn = cv2.projectPoints(points, turn, pose[:3, 3], result.K[side], result.distortion[side])[0].reshape(
                -1, 2
            )
            places.append(pixels)
            lengths.append(np.linalg.norm(drawn - pixels, axis=1))
    return np.concatenate(places), np.concatenate(lengths)
