# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's enumerations, with librealsense's numbers."""

from __future__ import annotations

from enum import IntEnum


class _Enum(IntEnum):
    def __str__(self) -> str:
        return f"{type(self).__name__}.{self.name}"


class stream(_Enum):
    any = 0
    depth = 1
    color = 2
    infrared = 3


class format(_Enum):
    any = 0
    z16 = 1
    disparity16 = 2
    xyz32f = 3
    rgb8 = 5
    bgr8 = 6
    rgba8 = 7
    bgra8 = 8
    y8 = 9
    y16 = 10
    disparity32 = 19


class option(_Enum):
    exposure = 3
    gain = 4
    enable_auto_exposure = 10
    visual_preset = 12
    laser_power = 13
    emitter_enabled = 18
    frames_queue_size = 19
    depth_units = 28
    color_scheme = 31
    histogram_equalization_enabled = 32
    min_distance = 33
    max_distance = 34
    filter_magnitude = 36
    filter_smooth_alpha = 37
    filter_smooth_delta = 38
    holes_fill = 39
    stereo_baseline = 40
    emitter_on_off = 46


class camera_info:
    """Plain numbers: a member of an IntEnum may not be called `name`."""

    name = 0
    serial_number = 1
    firmware_version = 2
    recommended_firmware_version = 3
    physical_port = 4
    advanced_mode = 6
    product_id = 7
    camera_locked = 8
    usb_type_descriptor = 9
    product_line = 10

    def __new__(cls, number: int) -> int:  # type: ignore[misc]  # scripts write camera_info(1)
        return int(number)


class distortion(_Enum):
    none = 0
    modified_brown_conrady = 1
    inverse_brown_conrady = 2
    ftheta = 3
    brown_conrady = 4


class rs400_visual_preset(_Enum):
    custom = 0
    default = 1
    hand = 2
    high_accuracy = 3
    high_density = 4
    medium_density = 5


class timestamp_domain(_Enum):
    hardware_clock = 0
    system_time = 1
    global_time = 2


class frame_metadata_value(_Enum):
    frame_counter = 0
    frame_timestamp = 1
    sensor_timestamp = 2
    actual_exposure = 3
    gain_level = 4
    auto_exposure = 5
    time_of_arrival = 7
    backend_timestamp = 9
    actual_fps = 10
    frame_laser_power = 11
    frame_laser_power_mode = 12


class log_severity(_Enum):
    debug = 0
    info = 1
    warn = 2
    error = 3
    fatal = 4
    none = 5
