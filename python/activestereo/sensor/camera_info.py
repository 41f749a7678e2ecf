# SPDX-License-Identifier: Apache-2.0
"""A sensor's cameras as its calibration has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.plan import ir_intrinsics
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import SIDES
from activestereo.common.nearest import unknown
from activestereo.common.pose import Pose, camera_to_camera

CAMERAS = ("rgb", *SIDES)


@dataclass(frozen=True)
class CameraInfo:
    """One camera. k: 3x3, pixel centres at integers; distortion: OpenCV's 5 coefficients, or 8 of a rational lens;
    camera_to_rgb: 4x4 from its axes (x right, y down, z forward) to the RGB camera's, metres."""

    width: int
    height: int
    k: NDArray[np.float64]
    distortion: tuple[float, ...]
    camera_to_rgb: NDArray[np.float64]


def camera_info(config: StereoDepthSensorConfig, camera: str) -> CameraInfo:
    """camera: 'rgb', 'left' or 'right'; raises ValueError for another."""
    if camera not in CAMERAS:
        raise ValueError(unknown("camera", camera, CAMERAS))
    if camera == "rgb":
        width, height = config.rgb_resolution
        return CameraInfo(width, height, config.rgb_intrinsic.copy(), config.rgb_distortion, np.eye(4))
    k, distortion = ir_intrinsics(config, camera == "right")
    width, height = config.ir_resolution
    pose = config.trans_pose_r if camera == "right" else config.trans_pose_l
    return CameraInfo(width, height, k.copy(), tuple(distortion), camera_to_camera(pose, Pose()))
