# SPDX-License-Identifier: Apache-2.0
"""Adapts sensors to simulators whose cameras have a field of view but no principal point."""

from __future__ import annotations

from copy import deepcopy

import numpy as np

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.sensor.gbuffer.stereo import GBufferStereo

_CENTRED_PX = 0.01


def centred(config: StereoDepthSensorConfig) -> StereoDepthSensorConfig:
    """Returns a copy of the configuration with the infrared cameras' principal points in the middle of the image."""
    out = deepcopy(config)
    middle = (np.array(config.ir_resolution) - 1.0) / 2.0
    for name in ("ir_intrinsic", "ir_intrinsic_right"):
        if getattr(config, name) is not None:
            k = getattr(config, name).copy()
            k[:2, 2] = middle
            setattr(out, name, k)
    return out


def fitted(
    config: StereoDepthSensorConfig, width: int, height: int, fovx_deg: float, supersampling: int
) -> StereoDepthSensorConfig:
    """Returns a centred configuration for images of width x height pixels with the field of view fovx_deg. The images
    have `supersampling` times the sensor's rows and columns. Raises ValueError unless it divides both."""
    if supersampling < 1 or width % supersampling or height % supersampling:
        raise ValueError(f"supersampling is {supersampling}: images of {width}x{height} are no multiple of it")
    return centred(config.resized(width // supersampling, height // supersampling, fovx_deg))


def vertical_fov_deg(sensor: GBufferStereo) -> float:
    """Returns the sensor's vertical field of view, degrees. Raises ValueError if the principal point is not in the
    middle or pixels are not square."""
    k, (_, height, width) = sensor.k, sensor.input_shape
    off_px = k[:2, 2] - (np.array([width, height]) - 1.0) / 2.0
    if np.abs(off_px).max() > _CENTRED_PX or abs(k[0, 0] / k[1, 1] - 1.0) > 1e-3:
        text = f"the principal point is {np.round(off_px, 2).tolist()} px beside the middle, focal lengths are"
        raise ValueError(f"{text} {k[0, 0]:.2f} and {k[1, 1]:.2f} px: make the sensor of centred(config)")
    return float(2.0 * np.rad2deg(np.arctan(0.5 * height / k[1, 1])))
