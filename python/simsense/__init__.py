# SPDX-License-Identifier: Apache-2.0
"""simsense: stereo depth engine (imager noise, rectification, census, semi-global matching, checks, registration).

Metres; camera x right, y down, z forward; depth is z, 0 = invalid; disparity in pixels, -1 = invalid; a 4x4 named
a_to_b maps coordinates in a to coordinates in b. `Engine` gives access to all stages; `DepthSensor` keeps the arguments
of the published SimSense; `StereoSGM` keeps those of cv2.StereoSGBM.

    engine = simsense.Engine(simsense.Device("host"), left, right, left_to_right, rectified=True, max_disparity=96)
    depth = engine.compute(left_image, right_image)["depth"]
"""

from ._simsense import (
    FAULTS,
    REASONS,
    ArgumentError,
    Buffer,
    BufferDesc,
    Camera,
    CancelledError,
    Device,
    DeviceInfo,
    Engine,
    Error,
    FileError,
    Image,
    MissingFileError,
    NoDeviceError,
    Submission,
    __version__,
    default_parameters,
    distort,
    fold_radius2,
    signal_analogue,
    signal_preset,
    undistort,
)
from .depth_sensor import DepthSensor, SettingError
from .stereo_sgm import StereoSGM

__all__ = [
    "FAULTS",
    "REASONS",
    "ArgumentError",
    "Buffer",
    "BufferDesc",
    "Camera",
    "CancelledError",
    "DepthSensor",
    "Device",
    "DeviceInfo",
    "Engine",
    "Error",
    "FileError",
    "Image",
    "MissingFileError",
    "NoDeviceError",
    "SettingError",
    "StereoSGM",
    "Submission",
    "default_parameters",
    "distort",
    "fold_radius2",
    "signal_analogue",
    "signal_preset",
    "undistort",
]
