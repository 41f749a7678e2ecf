# SPDX-License-Identifier: Apache-2.0
"""Frames of a data set as they lie on disk, for those who write them in other formats."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.generate import bop
from activestereo.capture.images import read_color, read_gray
from activestereo.common.input_files import read_json

# Frames of a data set are no film; formats with times get this interval.
FRAMES_PER_S = 30


@dataclass(frozen=True)
class Stored:
    """rgb: uint8 [h, w, 3]; depth_mm, depth_true_mm: uint16 [h, w], 0 = none; ir_left, ir_right: [h, w]; k: 3x3, of the
    RGB camera; camera_to_world: 4x4, metres, camera axes x right, y down, z forward."""

    number: int
    rgb: NDArray[np.uint8]
    depth_mm: NDArray[np.uint16]
    depth_true_mm: NDArray[np.uint16]
    ir_left: NDArray[Any]
    ir_right: NDArray[Any]
    k: NDArray[np.float64]
    camera_to_world: NDArray[np.float64]


def stored_frames(out: Path, count: int) -> Iterator[Stored]:
    """Frames 0 to count - 1, one at a time."""
    for number in range(count):
        folder, name = bop.scene_folder(out, number), f"{number % bop.FRAMES_PER_SCENE:06d}.png"
        depth, true, left, right = (
            read_gray(folder / kind / name) for kind in ("depth", "depth_true", "ir_left", "ir_right")
        )
        camera = read_json(bop.record_path(out, number))["camera"]
        world_to_camera = np.eye(4)
        world_to_camera[:3, :3] = np.reshape(camera["cam_R_w2c"], (3, 3))
        world_to_camera[:3, 3] = np.array(camera["cam_t_w2c"]) / 1000.0
        k = np.reshape(np.array(camera["cam_K"], np.float64), (3, 3))
        yield Stored(
            number, read_color(folder / "rgb" / name), depth, true, left, right, k, np.linalg.inv(world_to_camera)
        )
