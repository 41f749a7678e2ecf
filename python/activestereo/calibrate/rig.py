# SPDX-License-Identifier: Apache-2.0
"""Calibrates both infrared cameras from frames of a board: K, lenses, the right camera's pose, and every board's pose.
Also draws a picture of the corners' coverage.

OpenCV's calibrateCamera (Zhang 2000) gives the start. A bundle adjustment over all unknowns gives the answer and its
deviations, which are multiplied by 1.1 because corners' errors are not Gaussian."""

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
from activestereo.calibrate.least_squares import INTERVAL_90, deviations, difference, motion, vector
from activestereo.capture.capture import SIDES, Camera
from activestereo.capture.images import read_gray
from activestereo.common.output_files import replace_file
from activestereo.common.palette import INK, MUTED
from activestereo.model import Rig, SensorModel

_LEAST_BOARDS, _FEW_BOARDS = 3, 10
# A view whose RMS exceeds the median by this factor is a false detection.
_OUTLIER = 5.0
_COVERAGE_CELLS = (8, 6)
_INFLATION = 1.1

Matrices = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class BoardView:
    """A board's corners in one frame pair, {side: (board points [n, 3], pixels [n, 2])}. A camera that does not see the
    board is absent."""

    name: str
    corners: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]


@dataclass(frozen=True)
class Calibration:
    """The calibration of a camera pair. K, distortion: by side. left_to_right: 4x4. board_to_left: {view's name: 4x4}.
    error: standard deviations, {side: of fx, fy, cx, cy; 'translation': of left_to_right's}. rms_px: of the residuals.
    coverage: {side: share of the picture's cells that contain corners}."""

    size: tuple[int, int]
    K: Matrices
    distortion: Matrices
    left_to_right: NDArray[np.float64]
    board_to_left: Matrices
    error: Matrices
    rms_px: float
    coverage: dict[str, float]
    views: tuple[BoardView, ...]
    bit_depth: int

    def model(self) -> SensorModel:
        """Returns a SensorModel of the calibrated stereo rig, which save() writes as model.json."""
        left, right = (Camera(*self.size, self.K[side], self.distortion[side]) for side in SIDES)
        errors = "; ".join(
            f"{side} f ± {INTERVAL_90 * self.error[side][0]:.2g}, c ± {INTERVAL_90 * self.error[side][2]:.2g} px"
            for side in SIDES
        )
        source = f"calibrate rig: {len(self.views)} boards, {self.rms_px:.3f} px RMS, 90 %: {errors}"
        return SensorModel(rig=Rig(left, right, self.left_to_right, bit_depth=self.bit_depth, source=source))

    def summary(self) -> str:
        """Describes the calibration as text, which the command prints."""
        lines = [f"{len(self.views)} boards, {self.rms_px:.3f} px RMS (values with 90 % intervals)"]
        for side in SIDES:
            K, half = self.K[side], INTERVAL_90 * self.error[side]
            numbers = zip(("fx", "fy", "cx", "cy"), (K[0, 0], K[1, 1], K[0, 2], K[1, 2]), half, strict=True)
            words = ", ".join(f"{name} {value:.2f} ± {h:.2f}" for name, value, h in numbers)
            lens = ", ".join(f"{d:.4f}" for d in self.distortion[side])
            lines.append(
                f"{side}: {words} px; lens {lens}; corners reach {100 * self.coverage[side]:.0f} % of the picture"
            )
        t, e = 1e3 * self.left_to_right[:3, 3], 1e3 * INTERVAL_90 * self.error["translation"]
        angle = difference(np.eye(4), self.left_to_right)[1]
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
    """Calibrates from PATH/left/*.png and PATH/right/*.png, which are paired by name.

    has_lens: fits five distortion coefficients; otherwise images must be rectified, and both lenses are ideal. known_K:
    3x3 of both cameras, which is kept (a device's own). Raises ValueError with file, number and remedy: no pairs, sizes
    that differ, fewer than 3 boards found."""
    tell = progress or (lambda fraction: None)
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
        tell(0.7 * (number + 1) / len(both))
    seen = sum(len(view.corners) == 2 for view in views)
    if size is None or seen < _LEAST_BOARDS:
        raise ValueError(
            f"{path}: {seen} of {len(both)} frame pairs show the board to both cameras, at least {_LEAST_BOARDS} are "
            "needed: check --board, light the board evenly with the projector off, and keep all of a chessboard in "
            "view"
        )
    result = calibrate(views, size, has_lens, known_K, depth)
    tell(1.0)
    return result


def calibrate(
    views: list[BoardView],
    size: tuple[int, int],
    has_lens: bool = True,
    known_K: NDArray[np.float64] | None = None,
    bit_depth: int = 8,
) -> Calibration:
    """Computes the Calibration from boards' corners. False detections are dropped, and the rest is fitted again."""
    result, rms = _bundle(views, size, has_lens, known_K, bit_depth)
    limit = _OUTLIER * float(np.median(list(rms.values())))
    good = [view for view in views if rms.get(view.name, 0.0) <= limit]
    if len(good) == len(views) or sum(len(v.corners) == 2 for v in good) < _LEAST_BOARDS:
        return result
    return _bundle(good, size, has_lens, known_K, bit_depth)[0]


def _bundle(
    views: list[BoardView], size: tuple[int, int], has_lens: bool, known_K: NDArray[np.float64] | None, bit_depth: int
) -> tuple[Calibration, dict[str, float]]:
    """Adjusts all unknowns and returns (the Calibration, {view: RMS of its residuals, pixels}). The unknowns are each
    camera's fx, fy, cx, cy and lens, left_to_right, and a pose for each board."""
    first_K, first_lens, first_right, boards = _start(views, size, has_lens, known_K)
    views = [view for view in views if view.name in boards]
    own = 0 if known_K is not None else 9 if has_lens else 4
    cameras = [np.r_[first_K[side][(0, 1, 0, 1), (0, 1, 2, 2)], first_lens[side]][:own] for side in SIDES]
    first = np.concatenate([*cameras, vector(first_right), *(vector(boards[view.name]) for view in views)])

    def unpacked(x: NDArray[np.float64]) -> tuple[Matrices, Matrices, list[NDArray[np.float64]]]:
        """Splits the solver's vector into (K and distortion by side, [left_to_right, each board's pose], 4x4)."""
        K, lenses = dict(first_K), {side: np.zeros(5) for side in SIDES}
        for number, side in enumerate(SIDES if own else ()):
            fx, fy, cx, cy, *lens = x[number * own : (number + 1) * own]
            K[side] = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
            lenses[side][: len(lens)] = lens
        return K, lenses, [motion(part) for part in x[2 * own :].reshape(-1, 6)]

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        K, lenses, (left_to_right, *poses) = unpacked(x)
        to_side = {"left": np.eye(4), "right": left_to_right}
        return np.concatenate(
            [
                (_drawn(points, to_side[side] @ pose, K[side], lenses[side]) - pixels).ravel()
                for view, pose in zip(views, poses, strict=True)
                for side, (points, pixels) in view.corners.items()
            ]
        )

    # A residual depends on its camera and its board; in the right camera it also depends on left_to_right.
    rows = [2 * sum(len(pixels) for _, pixels in view.corners.values()) for view in views]
    sparsity, row = lil_matrix((sum(rows), len(first)), dtype=int), 0
    for number, view in enumerate(views):
        for side, (_, pixels) in view.corners.items():
            camera, board, end = SIDES.index(side) * own, 2 * own + 6 * (number + 1), row + 2 * len(pixels)
            sparsity[row:end, camera : camera + own] = sparsity[row:end, board : board + 6] = 1
            if side == "right":
                sparsity[row:end, 2 * own : 2 * own + 6] = 1
            row = end
    solution = least_squares(residuals, first, jac_sparsity=sparsity, x_scale="jac", method="trf", max_nfev=60)
    rest = residuals(solution.x)
    error = _INFLATION * deviations(solution, rest)
    K, lenses, (left_to_right, *poses) = unpacked(solution.x)
    errors = {side: error[n * own : n * own + 4] if own else np.zeros(4) for n, side in enumerate(SIDES)}
    coverage = {}
    for side in SIDES:
        pixels = np.concatenate([view.corners[side][1] for view in views if side in view.corners])
        cells = (pixels / np.array(size) * np.array(_COVERAGE_CELLS)).astype(int)
        reached = np.unique(np.clip(cells, 0, np.array(_COVERAGE_CELLS) - 1), axis=0)
        coverage[side] = len(reached) / float(np.prod(_COVERAGE_CELLS))
    result = Calibration(
        size, K, lenses, left_to_right, {view.name: pose for view, pose in zip(views, poses, strict=True)},
        errors | {"translation": error[2 * own + 3 : 2 * own + 6]}, float(np.sqrt(2.0 * np.mean(rest**2))), coverage,
        tuple(views), bit_depth,
    )  # fmt: skip
    parts = np.split(rest, np.cumsum(rows)[:-1])
    return result, {view.name: float(np.sqrt(2.0 * np.mean(p**2))) for view, p in zip(views, parts, strict=True)}


def _start(
    views: list[BoardView], size: tuple[int, int], has_lens: bool, known_K: NDArray[np.float64] | None
) -> tuple[Matrices, Matrices, NDArray[np.float64], Matrices]:
    """Returns (K, lenses, left_to_right, {view: board's pose in the left camera}) by OpenCV's calibration of each
    camera."""
    K, lenses, poses = {}, {}, {}
    flags = 0 if has_lens else cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    for side in SIDES:
        seen = [view for view in views if side in view.corners]
        points, pixels = ([view.corners[side][k].astype(np.float32) for view in seen] for k in (0, 1))
        if known_K is None:
            _, K[side], lens, turns, places = cv2.calibrateCamera(points, pixels, size, None, None, flags=flags)
            lenses[side] = np.ravel(lens)[:5]
        else:
            K[side], lenses[side] = np.array(known_K, dtype=np.float64), np.zeros(5)
            solved = [cv2.solvePnP(p, q, K[side], lenses[side])[1:] for p, q in zip(points, pixels, strict=True)]
            turns, places = zip(*solved, strict=True)
        poses[side] = {v.name: motion(np.concatenate([r, t])) for v, r, t in zip(seen, turns, places, strict=True)}
    between = [
        vector(poses["right"][name] @ np.linalg.inv(pose))
        for name, pose in poses["left"].items()
        if name in poses["right"]
    ]
    left_to_right = motion(np.median(between, axis=0))
    from_right = {name: np.linalg.inv(left_to_right) @ pose for name, pose in poses["right"].items()}
    return K, lenses, left_to_right, from_right | poses["left"]


def _drawn(
    points: NDArray[np.float64], pose: NDArray[np.float64], K: NDArray[np.float64], lens: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Projects points [n, 3] to pixels [n, 2] of a camera. pose: 4x4 from the points' to the camera's frame."""
    return np.asarray(cv2.projectPoints(points, *np.split(vector(pose), 2), K, lens)[0].reshape(-1, 2))


def write_coverage(path: Path, result: Calibration) -> None:
    """Writes a PNG with each camera's corners, coloured by their residuals in pixels."""
    figure = Figure(figsize=(11.0, 4.1), facecolor="white", layout="constrained")
    width, height = result.size
    shown = None
    for axes, side in zip(figure.subplots(1, 2), SIDES, strict=True):
        to_side = np.eye(4) if side == "left" else result.left_to_right
        corners = [
            (to_side @ result.board_to_left[v.name], *v.corners[side]) for v in result.views if side in v.corners
        ]
        places = np.concatenate([pixels for _, _, pixels in corners])
        drawn = np.concatenate([_drawn(p, pose, result.K[side], result.distortion[side]) for pose, p, _ in corners])
        shown = axes.scatter(
            *places.T, c=np.linalg.norm(drawn - places, axis=1), s=7, cmap="viridis", vmin=0.0,
            vmax=max(4.0 * result.rms_px, 1e-3),
        )  # fmt: skip
        axes.set(xlim=(0, width), ylim=(height, 0), aspect="equal")
        title = f"{side}: {len(places)} corners reach {100 * result.coverage[side]:.0f} % of the picture"
        axes.set_title(title, size=10, color=INK, loc="left")
        axes.tick_params(labelsize=8, colors=MUTED)
    figure.colorbar(shown, ax=figure.axes, shrink=0.8).set_label("left over, px", size=9, color=MUTED)
    replace_file(path, lambda file: figure.savefig(file, format="png", dpi=110))
