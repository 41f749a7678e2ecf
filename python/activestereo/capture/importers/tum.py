# SPDX-License-Identifier: Apache-2.0
"""Reads folders in the layout of the TUM RGB-D benchmark (Sturm et al., IROS 2012). rgb.txt and depth.txt list files by
time, groundtruth.txt the camera's poses; depth images have 5000 units per metre."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.importers.color_depth import ColorDepthFrame, ColorDepthRecording, nearest
from activestereo.capture.importers.trajectory import pose_at, read_trajectory
from activestereo.common.input_files import read_text
from activestereo.common.own_files import own_file

_UNIT_M = 1.0 / 5000.0
_WITHIN_S = 0.02


def read_tum(folder: Path, K: NDArray[np.float64] | None, depth_scale: float | None = None) -> ColorDepthRecording:
    """Reads a folder as a ColorDepthRecording. K: 3x3, which the layout lacks; None raises. Raises ValueError with
    file, line and value."""
    if K is None:
        raise ValueError(f"{folder}: K: the TUM layout has none: give --k FX,FY,CX,CY of the colour camera")
    colors, depths = (_listed(folder / name) for name in ("rgb.txt", "depth.txt"))
    poses = read_trajectory(folder / "groundtruth.txt") if (folder / "groundtruth.txt").is_file() else None
    frames = []
    for time_s, depth in depths.items():
        at = nearest(colors, time_s, _WITHIN_S)
        if at is None or (poses is not None and not poses[0][0] - 0.05 <= time_s <= poses[0][-1] + 0.05):
            continue  # recordings begin and end a little before and after their poses
        pose = None if poses is None else pose_at(*poses, time_s, str(depth))
        frames.append(ColorDepthFrame(time_s, depth, colors[at], _UNIT_M if depth_scale is None else depth_scale, pose))
    if not frames:
        raise ValueError(f"{folder}: no depth image has a colour image within {_WITHIN_S} s and a pose")
    return ColorDepthRecording(folder, "a TUM folder", K, tuple(frames))


def _listed(path: Path) -> dict[float, Path]:
    out: dict[float, Path] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            time_s = float(words[0])
        except ValueError:
            time_s = np.nan
        if len(words) != 2 or not np.isfinite(time_s):
            raise ValueError(f"{path}: line {number}: '{line.strip()}' is not a time and a file")
        try:
            out[time_s] = own_file(path.parent, words[1])
        except ValueError as error:
            raise ValueError(f"{path}: line {number}: {error}") from error
    return out
