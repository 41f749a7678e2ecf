# SPDX-License-Identifier: Apache-2.0
"""Offers pyrealsense2's names for a simulated camera; `import activestereo.realsense as rs` takes them from here."""

from typing import NoReturn

from activestereo.integrations.realsense.camera import LATENCY_MS, World
from activestereo.integrations.realsense.filters import (
    align,
    colorizer,
    decimation_filter,
    disparity_transform,
    filter,
    hole_filling_filter,
    pointcloud,
    points,
    save_to_ply,
    spatial_filter,
    temporal_filter,
    threshold_filter,
)
from activestereo.integrations.realsense.frames import (
    composite_frame,
    depth_frame,
    disparity_frame,
    extrinsics,
    frame,
    frame_queue,
    intrinsics,
    rs2_deproject_pixel_to_point,
    rs2_project_point_to_pixel,
    rs2_transform_point_to_point,
    stream_profile,
    video_frame,
    video_stream_profile,
)
from activestereo.integrations.realsense.options import (
    camera_info,
    distortion,
    format,
    frame_metadata_value,
    option,
    option_range,
    rs400_visual_preset,
    stream,
    timestamp_domain,
)
from activestereo.integrations.realsense.pipeline import (
    config,
    context,
    depth_sensor,
    device,
    device_list,
    pipeline,
    pipeline_profile,
    pipeline_wrapper,
    rs400_advanced_mode,
    sensor,
    simulate,
)
from activestereo.integrations.realsense.ros_topics import write_topics


def __getattr__(name: str) -> NoReturn:
    raise AttributeError(f"a simulated camera has no pyrealsense2.{name} (what it has: {__package__}/README.md)")
