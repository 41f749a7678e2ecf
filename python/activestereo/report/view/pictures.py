# SPDX-License-Identifier: Apache-2.0
"""Infrared pairs without a calibration, as a capture without a scene: a recording's folder, a data set of `activestereo
generate`, output of `activestereo simulate`. Their cameras are a preset's."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from activestereo.camera.plan import ir_intrinsics
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Camera, Capture, Frame, Projector, Rig
from activestereo.capture.images import image_size, read_gray
from activestereo.capture.importers.realsense_folder import frame_files
from activestereo.common.pose import camera_to_camera

SIDES = ("ir_left", "ir_right")
# The file that a capture of pictures has no use for.
_NONE = Path("none")


def is_pictures(folder: Path) -> bool:
    """Whether a folder's names are pairs of simulate, or of a data set."""
    return all((folder / f"{side}.png").is_file() for side in SIDES) or all((folder / side).is_dir() for side in SIDES)


def pictures_capture(folder: Path, config: StereoDepthSensorConfig) -> Capture:
    """The capture of all pairs in a folder. config: the camera, resized to the images. Raises ValueError without
    pairs."""
    pairs = _pairs(folder)
    size, bits = image_size(pairs[0][0]), 8 * read_gray(pairs[0][0]).dtype.itemsize
    if size != config.ir_resolution:
        scaled = config.scaled(size[0] / config.ir_resolution[0])
        config = scaled if scaled.ir_resolution == size else config.resized(*size)
    left, right = (
        Camera(*size, *(np.array(part) for part in ir_intrinsics(config, is_right))) for is_right in (False, True)
    )
    left_to_right = camera_to_camera(config.trans_pose_l, config.trans_pose_r)
    rig = Rig(left, right, left_to_right, Projector(_NONE, np.eye(3), np.eye(4)), bits)
    frames = tuple(
        Frame(number, *pair, 0.0, config.ir_camera_exposure, np.eye(4), "train") for number, pair in enumerate(pairs)
    )
    title = f"{folder.name}, with the nominal figures of the {config.model}"
    return Capture(folder, title, _NONE, rig, frames, {"max_disparity": config.max_disparity})


def _pairs(folder: Path) -> list[tuple[Path, Path]]:
    left, right = (folder / f"{side}.png" for side in SIDES)
    if left.is_file() and right.is_file():
        return [(left, right)]
    left, right = (folder / side for side in SIDES)
    if left.is_dir() and right.is_dir():
        both = [(path, right / path.name) for path in sorted(left.glob("*.png")) if (right / path.name).is_file()]
        if not both:
            raise ValueError(f"{folder}: {SIDES[0]} and {SIDES[1]} hold no images of the same names")
        return both
    return [(entry.files["left"], entry.files["right"]) for entry in frame_files(folder)]
