# SPDX-License-Identifier: Apache-2.0
"""A sensor's cameras as its calibration has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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


_LENSES = {4: "kannala_brandt", 5: "brown_conrady", 8: "rational"}


def cameras_json(config: StereoDepthSensorConfig, rgb_to_world: NDArray[np.float64]) -> dict[str, Any]:
    """The contents of simulate's camera.json. rgb_to_world: 4x4, the RGB camera's axes to the scene's, metres."""
    cameras = {}
    for name in CAMERAS:
        camera = camera_info(config, name)
        cameras["rgb" if name == "rgb" else f"ir_{name}"] = {
            "image": "rgb.png" if name == "rgb" else f"ir_{name}.png",
            "width": camera.width,
            "height": camera.height,
            "K": camera.k.tolist(),
            "distortion_model": _LENSES[len(camera.distortion)],
            "distortion": list(camera.distortion),
            "camera_to_rgb": camera.camera_to_rgb.tolist(),
            "camera_to_world": (rgb_to_world @ camera.camera_to_rgb).tolist(),
        }
    depth = {"image": "depth.png", "frame": "rgb", "metres_per_unit": 0.001, "no_measurement": 0}
    return {
        "sensor": config.model,
        "units": "metres; K and distortion for pixels whose centres are whole numbers",
        "frame_axes": "x right, y down, z forward; world: the scene file's",
        "baseline_m": config.focal_baseline_px_m / float(config.ir_intrinsic[0, 0]),
        "cameras": cameras,
        "depth": depth,
    }
