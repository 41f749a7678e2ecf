# SPDX-License-Identifier: Apache-2.0
"""Defines pyrealsense2's enumerations, with librealsense's numbers (SDK 2.59, include/librealsense2/h), and options of
sensors and filters. Groups the advanced mode's JSON keys by control, with the names, keys and scales of
librealsense's src/ds/advanced_mode/json_loader.hpp."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache

from activestereo.camera.advanced_mode.settings import Key, keys


class _Enum(IntEnum):
    def __str__(self) -> str:
        return f"{type(self).__name__}.{self.name}"


class stream(_Enum):
    (
        any, depth, color, infrared, fisheye, gyro, accel, gpio, pose, confidence, motion, safety, occupancy,
        labeled_point_cloud, object_detection,
    ) = range(15)  # fmt: skip


class format(_Enum):
    (
        any, z16, disparity16, xyz32f, yuyv, rgb8, bgr8, rgba8, bgra8, y8, y16, raw10, raw16, raw8, uyvy,
        motion_raw, motion_xyz32f, gpio_raw, six_dof, disparity32, y10bpack, distance, mjpeg, y8i, y12i, inzi,
        invi, w10, z16h, fg, y411,
    ) = range(31)  # fmt: skip
    y16i, m420, combined_motion, nv12, h264 = range(31, 36)


class option(_Enum):
    (
        backlight_compensation, brightness, contrast, exposure, gain, gamma, hue, saturation, sharpness,
        white_balance, enable_auto_exposure, enable_auto_white_balance, visual_preset, laser_power, accuracy,
        motion_range, filter_option, confidence_threshold, emitter_enabled, frames_queue_size,
        total_frame_drops, fisheye_auto_exposure_mode, power_line_frequency, asic_temperature,
        error_polling_enabled, projector_temperature, output_trigger_enabled, motion_module_temperature,
        depth_units, enable_motion_correction, auto_exposure_priority, color_scheme,
        histogram_equalization_enabled, min_distance, max_distance, texture_source, filter_magnitude,
        filter_smooth_alpha, filter_smooth_delta, holes_fill, stereo_baseline, auto_exposure_converge_step,
        inter_cam_sync_mode, stream_filter, stream_format_filter, stream_index_filter, emitter_on_off,
        zero_order_point_x, zero_order_point_y, ldd_temperature, mc_temperature, ma_temperature,
        hardware_preset, global_time_enabled, apd_temperature, enable_mapping, enable_relocalization,
        enable_pose_jumping, enable_dynamic_calibration, depth_offset, led_power, zero_order_enabled,
        enable_map_preservation, freefall_detection_enabled, receiver_gain, post_processing_sharpening,
        pre_processing_sharpening, noise_filtering, invalidation_bypass, digital_gain, sensor_mode,
        emitter_always_on, thermal_compensation, trigger_camera_accuracy_health, reset_camera_accuracy_health,
        host_performance, hdr_enabled, sequence_name, sequence_size, sequence_id, humidity_temperature,
        enable_max_usable_range, alternate_ir, noise_estimation, enable_ir_reflectivity, auto_exposure_limit,
        auto_gain_limit, auto_rx_sensitivity, transmitter_frequency, vertical_binning, receiver_sensitivity,
        auto_exposure_limit_toggle, auto_gain_limit_toggle, emitter_frequency, auto_exposure_mode,
        ohm_temperature, soc_pvt_temperature, gyro_sensitivity, region_of_interest, rotation,
        safety_preset_active_index, safety_mode, rgb_tnr_enabled, safety_mcu_temperature, left_ir_temperature,
        embedded_filter_enabled,
        disparity_shift, threshold, downscale_ratio, readout_shaping, detection_distance, sensors_config_mode,
        dual_rgb_rectification, emitter_mode, enable_aligned_depth,
    ) = range(115)  # fmt: skip
    ambient_light = digital_gain


class camera_info:
    """Numbers of a device's information texts; plain integers, because a member of an IntEnum may not be called
    `name`."""

    (
        name, serial_number, firmware_version, recommended_firmware_version, physical_port, debug_op_code,
        advanced_mode, product_id, camera_locked, usb_type_descriptor, product_line, asic_serial_number,
        firmware_update_id, ip_address, dfu_device_path, connection_type, smcu_fw_version, imu_type,
        mipi_driver_version,
    ) = range(19)  # fmt: skip

    def __new__(cls, number: int) -> int:  # type: ignore[misc]  # scripts write camera_info(1)
        return int(number)


class distortion(_Enum):
    none, modified_brown_conrady, inverse_brown_conrady, ftheta, brown_conrady, kannala_brandt4 = range(6)


class rs400_visual_preset(_Enum):
    custom, default, hand, high_accuracy, high_density, medium_density, remove_ir_pattern, edge_enhancement = range(8)


class timestamp_domain(_Enum):
    hardware_clock = 0
    system_time = 1
    global_time = 2


class frame_metadata_value(_Enum):
    (
        frame_counter, frame_timestamp, sensor_timestamp, actual_exposure, gain_level, auto_exposure,
        white_balance, time_of_arrival, temperature, backend_timestamp, actual_fps, frame_laser_power,
        frame_laser_power_mode, exposure_priority, exposure_roi_left, exposure_roi_right, exposure_roi_top,
        exposure_roi_bottom, brightness, contrast, saturation, sharpness, auto_white_balance_temperature,
        backlight_compensation, hue, gamma, manual_white_balance, power_line_frequency,
        low_light_compensation, frame_emitter_mode, frame_led_power, raw_frame_size, gpio_input_data,
        sequence_name, sequence_id, sequence_size, trigger, preset, input_width, input_height,
        sub_preset_info, calib_info, crc,
    ) = range(43)  # fmt: skip


@dataclass
class option_range:
    min: float = 0.0
    max: float = 0.0
    step: float = 0.0
    default: float = 0.0


class Described:
    """Base of devices and sensors that state their name, serial number and other texts. info: {number of camera_info:
    text}."""

    info: dict[int, str] = {}

    def get_info(self, which: int) -> str:
        if which not in self.info:
            raise RuntimeError(f"info {which} not supported by the device")
        return self.info[which]


class Options:
    """Base of sensors and filters with librealsense's options. ranges: {option that can be set: its range}. read_only:
    {other option: its value}. on_change(option, value): called before an option takes a value; raises an error to
    refuse it."""

    def __init__(
        self, ranges: Mapping[option, option_range], read_only: Mapping[option, float] | None = None,
        on_change: Callable[[option, float], None] = lambda which, value: None,
    ) -> None:  # fmt: skip
        self._ranges, self._read_only, self._on_change = dict(ranges), dict(read_only or {}), on_change
        self._values = {which: r.default for which, r in self._ranges.items()} | self._read_only

    def supports(self, which: option) -> bool:
        return which in self._values

    def get_supported_options(self) -> list[option]:
        return list(self._values)

    def is_option_read_only(self, which: option) -> bool:
        return which in self._read_only

    def get_option(self, which: option) -> float:
        self._require(which)
        return self._values[which]

    def get_option_range(self, which: option) -> option_range:
        self._require(which)
        value = self._values[which]
        return self._ranges.get(which, option_range(value, value, 0.0, value))

    def get_option_description(self, which: option) -> str:
        self._require(which)
        return option(which).name.replace("_", " ")

    def set_option(self, which: option, value: float) -> None:
        """Sets an option. Raises RuntimeError, as librealsense does, for an unknown option or a value out of range."""
        self._require(which)
        if which in self._read_only:
            raise RuntimeError(f"option {option(which).name} is read only")
        r, value = self._ranges[which], float(value)
        if not r.min <= value <= r.max:
            name = option(which).name
            raise RuntimeError(f"out of range value for option {name}: {value:g}, expected {r.min:g} to {r.max:g}")
        self._on_change(which, value)
        self._values[which] = value

    def _require(self, which: option) -> None:
        if which not in self._values:
            known = which in option.__members__.values()
            name = option(which).name.replace("_", " ").title() if known else which
            raise RuntimeError(f"object doesn't support option {name}")


@cache
def controls() -> dict[str, dict[str, Key]]:
    """Returns the advanced mode's groups of controls: {group: {field of the control: key of the JSON}}."""
    groups: dict[str, dict[str, Key]] = {}
    for key in keys().values():
        group, _, name = key.control.partition(".")
        if name:
            groups.setdefault(group, {})[name] = key
    return groups
