# SPDX-License-Identifier: Apache-2.0
"""Records frames of a connected D4xx as a folder of PNG files and a DeviceText, as the bag reader makes them. Needs
librealsense's own package: pip install pyrealsense2."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from activestereo.capture.capture import Camera
from activestereo.capture.images import write_gray
from activestereo.capture.importers.realsense_text import DeviceText
from activestereo.common.output_files import write_png
from activestereo.common.pose import printed_motion

# Automatic exposure needs a second or so to settle.
_SETTLING_FRAMES = 30
_TIMEOUT_MS = 5000


def record_live(
    folder: Path, frame_count: int, size: tuple[int, int], progress: Callable[[float], None] | None = None
) -> tuple[DeviceText, float, float]:
    """Records frame_count frames of both infrared streams, depth and colour into `folder`. Returns (calibration, metres
    per unit of depth, exposure in seconds of the last frame). size: (width, height). Raises ValueError if pyrealsense2
    is missing, and librealsense's RuntimeError without a device, a mode of this size or frames."""
    try:
        import pyrealsense2 as rs
    except ImportError as error:
        raise ValueError("live: needs the package pyrealsense2, which is missing: pip install pyrealsense2") from error
    config, pipeline = rs.config(), rs.pipeline()
    for side in (1, 2):
        config.enable_stream(rs.stream.infrared, side, *size, rs.format.y8, 30)
    config.enable_stream(rs.stream.depth, *size, rs.format.z16, 30)
    config.enable_stream(rs.stream.color, *size, rs.format.rgb8, 30)
    profile = pipeline.start(config)
    try:
        scale = float(profile.get_device().first_depth_sensor().get_depth_scale())
        streams = {
            "Infrared 1": profile.get_stream(rs.stream.infrared, 1).as_video_stream_profile(),
            "Infrared 2": profile.get_stream(rs.stream.infrared, 2).as_video_stream_profile(),
            "Color": profile.get_stream(rs.stream.color).as_video_stream_profile(),
        }
        modes = {}
        for name, stream in streams.items():
            lens = stream.get_intrinsics()
            K = np.array([[lens.fx, 0.0, lens.ppx], [0.0, lens.fy, lens.ppy], [0.0, 0.0, 1.0]])
            modes[name, lens.width, lens.height] = Camera(
                lens.width, lens.height, K, np.array(lens.coeffs, dtype=float)
            )
        first = streams["Infrared 1"]
        between = {}
        for name in ("Infrared 2", "Color"):
            motion = first.get_extrinsics_to(streams[name])
            rotation = np.reshape(motion.rotation, (3, 3)).T  # librealsense keeps rotations column by column
            what = f'live: Extrinsic from "Infrared 1" To "{name}"'
            between["Infrared 1", name] = printed_motion(rotation, motion.translation, what)
        device = DeviceText(Path("live"), modes, between)
        exposure_s = 0.008
        for number in range(_SETTLING_FRAMES + frame_count):
            frames = pipeline.wait_for_frames(_TIMEOUT_MS)
            if number < _SETTLING_FRAMES:
                continue
            first = frames.get_infrared_frame(1)
            time_ms = float(first.get_timestamp())
            for side in (1, 2):
                image = np.array(frames.get_infrared_frame(side).get_data())
                write_gray(folder / f"Infrared {side} {time_ms:.3f}.png", image)
            write_gray(folder / f"Depth {time_ms:.3f}.png", np.array(frames.get_depth_frame().get_data()))
            write_png(folder / f"Color {time_ms:.3f}.png", np.array(frames.get_color_frame().get_data()))
            if first.supports_frame_metadata(rs.frame_metadata_value.actual_exposure):
                exposure_s = 1e-6 * float(first.get_frame_metadata(rs.frame_metadata_value.actual_exposure))
            if progress is not None:
                progress((number - _SETTLING_FRAMES + 1) / frame_count)
    finally:
        pipeline.stop()
    return device, scale, exposure_s
