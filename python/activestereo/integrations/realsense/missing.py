# SPDX-License-Identifier: Apache-2.0
"""Names of pyrealsense2 (SDK 2.59) that a simulated camera does not have, each with the reason."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

_REASONS = {
    "its depth needs no calibration: activestereo calibrate measures a real camera": (
        "auto_calibrated_device device_calibration calibration_change_device calib_location calib_target_type "
        "calibration_status calibration_type"
    ),
    "it has no filters inside: decimation_filter, temporal_filter and their like filter its frames": (
        "embedded_filter embedded_decimation_filter embedded_temporal_filter decimation_filter_dpp_config "
        "decimation_filter_dpp_range temporal_filter_dpp_config temporal_filter_dpp_range dpp_header"
    ),
    "it records with to_software_device() and pyrealsense2's recorder, and activestereo import plays": (
        "recorder playback playback_status save_single_frameset"
    ),
    "it has no motion sensors and no tracking": (
        "motion_sensor motion_frame motion_stream motion_stream_profile motion_device_intrinsic combined_motion "
        "pose pose_frame pose_sensor pose_stream pose_stream_profile quaternion vector wheel_odometer fisheye_sensor "
        "software_motion_frame software_pose_frame"
    ),
    "it has no firmware": (
        "updatable update_device firmware_logger firmware_log_message firmware_log_parsed_message terminal_parser "
        "debug_protocol serializable_device eth_config_device link_priority ip_address"
    ),
    "it is no safety or perception camera": (
        "safety_sensor safety_mode perception_sensor perception_frame perception_stream perception_stream_profile "
        "object_detection object_detection_frame labeled_points hdrd_control hdrd_control_range d500_intercam_sync_mode"
    ),
    "it is not simulated": (
        "hdr_merge sequence_id_filter rotation_filter yuy_decoder yuy2_converter uyvy_converter nv12_converter "
        "m420_converter processing_block filter_interface frame_source gpu_frame roi_sensor region_of_interest "
        "color_sensor depth_stereo_sensor debug_stream_sensor max_usable_range_sensor device_hub l500_visual_preset "
        "emitter_mode colored_ir_auto_exposure_mode notification notification_category software_notification "
        "event_information extension product_line option_type option_value options_list composite_option_id "
        "rs2_project_color_pixel_to_depth_pixel enable_metadata option_from_string "
        "texture_coordinate vertex log log_message log_to_callback log_to_file reset_logger enable_rolling_log_file"
    ),
}
NOT_SIMULATED = {name: reason for reason, names in _REASONS.items() for name in names.split()}


def reason(name: str) -> str:
    """The error message for a name."""
    return f"{name} is not there on a simulated camera: {NOT_SIMULATED[name]}"


class Castable:
    """is_X() and as_X() of pyrealsense2's classes X that are not simulated."""

    def __getattr__(self, name: str) -> Callable[[], Any]:
        what, _, kind = name.partition("_")
        if what not in ("is", "as") or kind not in NOT_SIMULATED:
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
        if what == "as":
            return partial(_refuse, kind)
        return lambda: False


def _refuse(kind: str) -> None:
    raise RuntimeError(reason(kind))
