# SPDX-License-Identifier: Apache-2.0
"""The coverage picture of a calibration: where corners were seen in each camera, and how far off each is."""

from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

from activestereo.calibrate.rig import Calibration
from activestereo.capture.capture import SIDES
from activestereo.common.output_files import replace_file
from activestereo.common.palette import INK, MUTED


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
