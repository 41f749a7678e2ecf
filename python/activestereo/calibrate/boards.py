# SPDX-License-Identifier: Apache-2.0
"""Reads the option `--board` and finds a calibration board's corners in a picture with OpenCV's detectors.

9x6:0.03                        chessboard with 9x6 inner corners, squares of 0.03 m
charuco:9x6:0.03:0.022          ChArUco board of 9x6 squares of 0.03 m with markers of 0.022 m
apriltag:6x4:0.04:0.01          grid of 6x4 AprilTags (36h11) of 0.04 m, 0.01 m apart
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

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
        if (
            len(lengths) != (1 if kind == "chessboard" else 2)
            or not all(0.0 < n < 10.0 for n in lengths)
            or not (2 < columns < 100 and 2 < rows < 100)
        ):
            raise ValueError(
                f"a board is {_EXAMPLES}, with 3 to 99 columns and rows and lengths in metres, not '{text}'"
            )
        if kind == "charuco" and lengths[1] >= lengths[0]:
            raise ValueError(f"the markers of '{text}' are as large as its squares")
        return cls(kind, columns, rows, *lengths)

    def find(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Finds the board's corners in an 8-bit image: (board points [n, 3] in metres, pixels [n, 2]); None if fewer
        than 8 are visible."""
        if self.kind != "chessboard":
            found = self._find_markers(image)
            return found if found is not None and len(found[0]) >= _LEAST_CORNERS else None
        # The sector-based detector (Duda and Frese 2018) finds every corner; its places are up to 0.08 px off to one
        # side where squares are small (0.6 % of a focal length at 424x240), which Foerstner's saddle points are not.
        is_found, corners = cv2.findChessboardCornersSB(
            image, (self.columns, self.rows), flags=cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE
        )
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
        parameters.cornerRefinementMethod = (
            cv2.aruco.CORNER_REFINE_APRILTAG if self.kind == "apriltag" else cv2.aruco.CORNER_REFINE_NONE
        )
        corners, ids, _ = cv2.aruco.detectMarkers(image, dictionary, parameters=parameters)
        if ids is None:
            return None
        if self.kind == "apriltag":
            points = {int(n): p for n, p in zip(np.ravel(board.ids), board.objPoints, strict=True)}
            seen = [
                (points[int(n)], c.reshape(4, 2))
                for n, c in zip(np.ravel(ids), corners, strict=True)
                if int(n) in points
            ]
            if not seen:
                return None
            pixels = np.concatenate([c for _, c in seen]).astype(np.float64)
            return np.concatenate([p for p, _ in seen]).astype(np.float64), pixels - _MARKER_SHIFT_PX
        count, places, numbers = cv2.aruco.interpolateCornersCharuco(corners, ids, image, board)
        if not count:
            return None
        return np.asarray(board.chessboardCorners)[np.ravel(numbers)].astype(np.float64), places.reshape(-1, 2).astype(
            np.float64
        ) - _MARKER_SHIFT_PX

    def _aruco_board(self) -> tuple[Any, Any]:
        """Makes OpenCV's (board, dictionary of markers). Raises ValueError if this OpenCV lacks them."""
        if not hasattr(cv2, "aruco") or not hasattr(cv2.aruco, "CharucoBoard_create"):
            raise ValueError(
                f"this OpenCV, {cv2.__version__}, has no aruco module as in 4.6: use a chessboard, or Debian's "
                "python3-opencv"
            )
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, _DICTIONARY[self.kind]))
        make = cv2.aruco.GridBoard_create if self.kind == "apriltag" else cv2.aruco.CharucoBoard_create
        return make(self.columns, self.rows, self.camera_m, self.second_m, dictionary), dictionary
