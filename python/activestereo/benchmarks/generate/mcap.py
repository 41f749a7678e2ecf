# SPDX-License-Identifier: Apache-2.0
"""Writes a data set as messages of ROS 2 into an MCAP file, DIR/mcap (pip install rosbags).

Topics have a RealSense camera's names: color, aligned depth (16UC1, millimetres: REP 118) and the infrared pair, each
with its camera_info; /camera/pose is the RGB camera's pose. Axes are those of REP 103's optical frames.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from activestereo.benchmarks.generate.bop import FRAMES_PER_S, Stored, stored_frames
from activestereo.common.input_files import read_json
from activestereo.common.mcap_file import McapFile
from activestereo.common.ros_images import camera_info_message, image_message

_COLOR = "camera_color_optical_frame"


def package() -> Any:
    """Imports and returns the module rosbags. Raises ImportError if it is missing."""
    try:
        import rosbags
    except ImportError as error:
        raise ImportError("rosbags is missing: pip install rosbags") from error
    return rosbags


def write(out: Path, count: int, to: Path) -> None:
    """Writes frames 0 to count - 1 of the data set `out` into the folder `to`, which must not exist."""
    infrared = read_json(out / "ir_cameras.json")
    with McapFile(to) as file:
        for frame in stored_frames(out, count):
            _write_frame(file, frame, infrared)


def _write_frame(file: McapFile, frame: Stored, infrared: dict[str, Any]) -> None:
    time_ns = frame.number * 10**9 // FRAMES_PER_S
    stamp = file.make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)

    def header(axes: str) -> Any:
        return file.make("std_msgs/msg/Header", stamp=stamp, frame_id=axes)

    left, right = infrared["ir_left"], infrared["ir_right"]
    lens, none = [0.0] * 5, 0.0
    streams: tuple[tuple[Any, ...], ...] = (
        ("color", "image_raw", frame.rgb, "rgb8", _COLOR, frame.k, lens, none),
        ("aligned_depth_to_color", "image_raw", frame.depth_mm.astype(np.uint16), "16UC1", _COLOR, frame.k, lens, none),
        ("infra1", "image_rect_raw", frame.ir_left, None, "camera_infra1_optical_frame", *_lens(left), none),
        ("infra2", "image_rect_raw", frame.ir_right, None, "camera_infra2_optical_frame", *_lens(right),
         -float(right["cam_K"][0]) * float(infrared["baseline_m"])),
    )  # fmt: skip
    for name, image, pixels, encoding, axes, k, distortion, tx in streams:
        topic = f"/camera/{name}"
        encoding = encoding or ("mono8" if pixels.dtype == np.uint8 else "mono16")
        message = image_message(file.make, header(axes), pixels, encoding)
        file.write(f"{topic}/{image}", "sensor_msgs/msg/Image", message, time_ns)
        info = camera_info_message(file.make, header(axes), pixels.shape[0], pixels.shape[1], k, distortion, tx)
        file.write(f"{topic}/camera_info", "sensor_msgs/msg/CameraInfo", info, time_ns)
    x, y, z, w = Rotation.from_matrix(frame.camera_to_world[:3, :3]).as_quat()
    at = dict(zip("xyz", map(float, frame.camera_to_world[:3, 3]), strict=True))
    pose = file.make(
        "geometry_msgs/msg/Pose",
        position=file.make("geometry_msgs/msg/Point", **at),
        orientation=file.make("geometry_msgs/msg/Quaternion", x=float(x), y=float(y), z=float(z), w=float(w)),
    )
    kind = "geometry_msgs/msg/PoseStamped"
    file.write("/camera/pose", kind, file.make(kind, header=header("world"), pose=pose), time_ns)


def _lens(camera: dict[str, Any]) -> tuple[NDArray[np.float64], list[float]]:
    return np.reshape(np.array(camera["cam_K"], np.float64), (3, 3)), list(camera["distortion"])
