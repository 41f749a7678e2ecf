# SPDX-License-Identifier: Apache-2.0
"""Finds a calibration board's corners with OpenCV's detectors, and calibrates both infrared cameras from them: K,
lenses, the right camera's pose, and every board's pose. Also draws a picture of the corners' coverage.

OpenCV's calibrateCamera (Zhang 2000) gives the start. A bundle adjustment over all unknowns gives the answer and its
deviations, which are multiplied by 1.1 because corners' errors are not Gaussian."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix

from activestereo.calibrate.least_squares import INTERVAL_90, deviations, difference, motion, vector
from activestereo.capture.capture import SIDES, Camera
from activestereo.capture.images import read_gray
from activestereo.common.output_files import replace_file
from activestereo.common.palette import INK, MUTED
from activestereo.common.progress_bar import Progress
from activestereo.model import Rig, SensorModel

KINDS = ("chessboard", "charuco", "apriltag")
_DICTIONARY = {"charuco": "DICT_5X5_250", "apriltag": "DICT_APRILTAG_36h11"}
_LEAST_CORNERS = 8
# OpenCV 4.6's marker detectors count pixels from their corners, so their results are half a pixel too far right and
# down for integer pixel centres. (test_calibrate_rig.py measures it on rendered boards; the chessboard's detector has
# no such shift.)
_MARKER_SHIFT_PX = 0.5
_EXAMPLES = "9x6:0.03, charuco:9x6:0.03:0.022 or apriltag:6x4:0.04:0.01"

# Half the window of a corner's refinement, as a share of the way to the next corner.
_REFINED_SHARE = 0.45
_REFINED_UNTIL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
_LEAST_BOARDS, _FEW_BOARDS = 3, 10
# A view whose RMS exceeds the median by this factor is a false detection.
_OUTLIER = 5.0
_COVERAGE_CELLS = (8, 6)
_INFLATION = 1.1

Matrices = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Board:
    """A calibration board. columns, rows: number of inner corners of a chessboard, squares of ChArUco, or tags of
    AprilTag. camera_m: side of a square or a tag. second_m: side of a marker inside a square, or gap between tags."""

    kind: str
    columns: int
    rows: int
    camera_m: float
    second_m: float = 0.0

    @classmethod
    def parse(cls, text: str) -> "Board":
        """Makes the board that a text of `--board` describes. Raises ValueError with the valid forms."""
        parts = text.split(":")
        kind = parts.pop(0) if parts[0] in KINDS else "chessboard"
        try:
            columns, rows = (int(n) for n in parts[0].lower().split("x"))
            lengths = [float(part) for part in parts[1:]]
        except (ValueError, IndexError):
            raise ValueError(f"a board is {_EXAMPLES}, not '{text}'") from None
        has_lengths = len(lengths) == (1 if kind == "chessboard" else 2) and all(0.0 < n < 10.0 for n in lengths)
        if not (has_lengths and 2 < columns < 100 and 2 < rows < 100):
            told = f"a board is {_EXAMPLES}, with 3 to 99 columns and rows and lengths in metres"
            raise ValueError(f"{told}, not '{text}'")
        if kind == "charuco" and lengths[1] >= lengths[0]:
            raise ValueError(f"the markers of '{text}' are as large as its squares")
        return cls(kind, columns, rows, *lengths)

    def find(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Finds the board's corners in an 8-bit image. Returns (board points [n, 3] in metres, pixels [n, 2]), or None
        if fewer than 8 are found."""
        if self.kind != "chessboard":
            found = self._find_markers(image)
            return found if found is not None and len(found[0]) >= _LEAST_CORNERS else None
        # The sector-based detector (Duda and Frese 2018) finds every corner; its places are up to 0.08 px off to one
        # side where squares are small (0.6 % of a focal length at 424x240), which Foerstner's saddle points are not.
        flags = cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE
        is_found, corners = cv2.findChessboardCornersSB(image, (self.columns, self.rows), flags=flags)
        if not is_found or len(corners) < _LEAST_CORNERS:
            return None
        corners = np.ascontiguousarray(corners.reshape(-1, 2), np.float32)
        apart = np.linalg.norm(np.diff(corners.reshape(self.rows, self.columns, 2), axis=1), axis=2).min()
        half = max(2, int(_REFINED_SHARE * apart))
        corners = cv2.cornerSubPix(image, corners, (half, half), (-1, -1), _REFINED_UNTIL)
        return self.chessboard_points(), corners.astype(np.float64)

    def chessboard_points(self) -> NDArray[np.float64]:
        """Returns a chessboard's inner corners [n, 3], row by row, in metres; the board lies in z = 0."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        return self.camera_m * np.column_stack([column, row, 0.0 * row]).astype(np.float64)

    def _find_markers(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        board, dictionary = self._aruco_board()
        parameters = cv2.aruco.DetectorParameters_create()
        refined = cv2.aruco.CORNER_REFINE_APRILTAG if self.kind == "apriltag" else cv2.aruco.CORNER_REFINE_NONE
        parameters.cornerRefinementMethod = refined
        corners, ids, _ = cv2.aruco.detectMarkers(image, dictionary, parameters=parameters)
        if ids is None:
            return None
        if self.kind == "apriltag":
            points = {int(n): p for n, p in zip(np.ravel(board.ids), board.objPoints, strict=True)}
            found = zip(map(int, np.ravel(ids)), corners, strict=True)
            seen = [(points[n], c.reshape(4, 2)) for n, c in found if n in points]
            if not seen:
                return None
            pixels = np.concatenate([c for _, c in seen]).astype(np.float64)
            return np.concatenate([p for p, _ in seen]).astype(np.float64), pixels - _MARKER_SHIFT_PX
        count, places, numbers = cv2.aruco.interpolateCornersCharuco(corners, ids, image, board)
        if not count:
            return None
        inner = np.asarray(board.chessboardCorners)[np.ravel(numbers)].astype(np.float64)
        return inner, places.reshape(-1, 2).astype(np.float64) - _MARKER_SHIFT_PX

    def _aruco_board(self) -> tuple[Any, Any]:
        """Makes OpenCV's (board, dictionary of markers). Raises ValueError if this OpenCV lacks them."""
        if not hasattr(cv2, "aruco") or not hasattr(cv2.aruco, "CharucoBoard_create"):
            told = f"this OpenCV, {cv2.__version__}, has no aruco module as in 4.6"
            raise ValueError(f"{told}: use a chessboard, or Debian's python3-opencv")
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, _DICTIONARY[self.kind]))
        make = cv2.aruco.GridBoard_create if self.kind == "apriltag" else cv2.aruco.CharucoBoard_create
        return make(self.columns, self.rows, self.camera_m, self.second_m, dictionary), dictionary


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
        half = {side: INTERVAL_90 * self.error[side] for side in SIDES}
        errors = "; ".join(f"{side} f ± {half[side][0]:.2g}, c ± {half[side][2]:.2g} px" for side in SIDES)
        source = f"calibrate rig: {len(self.views)} boards, {self.rms_px:.3f} px RMS, 90 %: {errors}"
        return SensorModel(rig=Rig(left, right, self.left_to_right, bit_depth=self.bit_depth, source=source))

    def summary(self) -> str:
        """Describes the calibration as text, which the command prints."""
        lines = [f"{len(self.views)} boards, {self.rms_px:.3f} px RMS (values with 90 % intervals)"]
        for side in SIDES:
            K, half = self.K[side], INTERVAL_90 * self.error[side]
            numbers = zip(("fx", "fy", "cx", "cy"), (K[0, 0], K[1, 1], K[0, 2], K[1, 2]), half, strict=True)
            words = ", ".join(f"{name} {value:.2f} ± {h:.2f}" for name, value, h in numbers)
            lens = ", ".join(f"{d:.4f}" for d in self.distortion[side]) if np.any(self.distortion[side]) else "none"
            reach = f"{100 * self.coverage[side]:.0f} % of the picture"
            lines.append(f"{side}: {words} px; lens {lens}; corners reach {reach}")
        t, e = 1e3 * self.left_to_right[:3, 3], 1e3 * INTERVAL_90 * self.error["translation"]
        angle = difference(np.eye(4), self.left_to_right)[1]
        place = ", ".join(f"{axis} {value:.3f} ± {half:.3f}" for axis, value, half in zip("xyz", t, e, strict=True))
        lines.append(f"right camera: {place} mm, turned {angle:.3f} deg")
        if len(self.views) < _FEW_BOARDS:
            more = "15 or more, tilted up to 40 deg and into every corner, halve the intervals"
            lines.append(f"only {len(self.views)} boards: {more}")
        return "\n".join(lines)


def calibrate_rig(
    path: Path, board: Board, has_lens: bool, known_K: NDArray[np.float64] | None, progress: Progress
) -> Calibration:
    """Calibrates from PATH/left/*.png and PATH/right/*.png, which are paired by name.

    has_lens: fits five distortion coefficients; otherwise images must be rectified, and both lenses are ideal. known_K:
    3x3 of both cameras, which is kept (a device's own). Raises ValueError with file, number and remedy: no pairs, sizes
    that differ, fewer than 3 boards found."""
    folders = {side: Path(path) / side for side in SIDES}
    names = {side: {file.name for file in folder.glob("*.png")} for side, folder in folders.items()}
    both = sorted(names["left"] & names["right"])
    if not both:
        told = "no PNG file is in both left/ and right/: give a folder with frames of both cameras under equal names"
        raise ValueError(f"{path}: {told}")
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
        progress(0.7 * (number + 1) / len(both))
    seen = sum(len(view.corners) == 2 for view in views)
    if size is None or seen < _LEAST_BOARDS:
        counts = f"{seen} of {len(both)} frame pairs show the board to both cameras, at least {_LEAST_BOARDS} are "
        remedy = "check --board, light the board evenly with the projector off, and keep all of a chessboard in view"
        raise ValueError(f"{path}: {counts}needed: {remedy}")
    result = calibrate(views, size, has_lens, known_K, depth)
    progress(1.0)
    return result


def calibrate(
    views: list[BoardView], size: tuple[int, int], has_lens: bool = True, known_K: NDArray[np.float64] | None = None,
    bit_depth: int = 8,
) -> Calibration:  # fmt: skip
    """Computes the Calibration from boards' corners. Views above 5 times the median RMS are false detections: they are
    dropped, and the rest is fitted again."""
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
        return np.concatenate([
            (_drawn(points, to_side[side] @ pose, K[side], lenses[side]) - pixels).ravel()
            for view, pose in zip(views, poses, strict=True)
            for side, (points, pixels) in view.corners.items()
        ])  # fmt: skip

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
        K[side], lenses[side] = np.array(np.eye(3) if known_K is None else known_K, dtype=np.float64), np.zeros(5)
        if known_K is None:
            K[side], lens = cv2.calibrateCamera(points, pixels, size, None, None, flags=flags)[1:3]
            lenses[side] = np.ravel(lens)[:5]
        solved = [cv2.solvePnP(p, q, K[side], lenses[side])[1:] for p, q in zip(points, pixels, strict=True)]
        poses[side] = {v.name: motion(np.concatenate(pose)) for v, pose in zip(seen, solved, strict=True)}
    both = poses["left"].keys() & poses["right"].keys()
    between = [vector(poses["right"][name] @ np.linalg.inv(poses["left"][name])) for name in sorted(both)]
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
        seen = [view for view in result.views if side in view.corners]
        corners = [(to_side @ result.board_to_left[view.name], *view.corners[side]) for view in seen]
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
