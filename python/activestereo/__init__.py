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

# The public names, each with the module that defines it.
_HOMES = {
    "Capture": "capture.capture",
    "Comparison": "compare.compare",
    "Diagnosis": "diagnose.diagnosis",
    "GBufferStereo": "sensor.gbuffer.stereo",
    "Lab": "lab",
    "Mount": "sensor.mounts",
    "Mounts": "sensor.mounts",
    "Pose": "common.pose",
    "SensorModel": "model.model",
    "StereoDepthSensor": "sensor.sensor",
    "StereoDepthSensorBatch": "sensor.batch",
    "StereoDepthSensorConfig": "camera.presets",
    "load_scene_file": "scene_io.scene_files",
    "read_capture": "capture.capture",
    "read_model": "model.read",
    "write_model": "model.write",
    "write_report": "report.write",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    # A module is imported on first use, so that captures, presets and --help load no renderer.
    if name == "__version__":  # kuafu's version is the packages' too: all are built together
        return import_module("kuafu").__version__
    if name not in _HOMES:
        raise AttributeError(f"module 'activestereo' has no attribute '{name}'")
    return getattr(import_module(f"activestereo.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*_HOMES, "__version__", *(name for name in globals() if name.startswith("__"))})
