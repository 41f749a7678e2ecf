# SPDX-License-Identifier: Apache-2.0
"""activestereo: simulated active stereo depth sensors (RealSense-like), from a scene file to a depth map.

from activestereo import StereoDepthSensor, StereoDepthSensorConfig

sensor = StereoDepthSensor(StereoDepthSensorConfig("D435"), "table_top.gltf")
sensor.take_picture()
sensor.compute_depth()
depth_m = sensor.get_depth()  # float32, registered to the RGB camera, 0 = no measurement
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "LateStereoDepthSensor": "late_sensor",
    "LateStereoDepthSensorBatch": "late_sensor_batch",
    "Mount": "sensor",
    "Mounts": "sensor_batch",
    "Pose": "pose",
    "SplitStereoDepthSensorBatch": "split_sensor_batch",
    "StereoDepthSensor": "sensor",
    "StereoDepthSensorBatch": "sensor_batch",
    "StereoDepthSensorConfig": "presets",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    # On first use, so that what needs no renderer (captures, presets, --help) does not load one.
    if name not in _HOMES:
        raise AttributeError(f"module 'activestereo' has no attribute '{name}'")
    return getattr(import_module(f"activestereo.{_HOMES[name]}"), name)
