# SPDX-License-Identifier: Apache-2.0
"""Writes framesets as topics of ROS 2's realsense2_camera 4.5x into an MCAP file with rosbags (pip install rosbags).

Names, frames and fields are those of its ros2-development branch (github.com/IntelRealSense/realsense-ros). Qualities
of service are those in the recording of its issue 3472; topics that it lacks get the same."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.common.mcap_file import McapFile, camera_info_message, header_message, image_message
from activestereo.integrations.realsense.frames import composite_frame, video_stream_profile
from activestereo.integrations.realsense.options import format, frame_metadata_value, stream, timestamp_domain

Key = tuple[stream, int]
# {stream: (its name in topics, its image's name)}, in the order of the device's sensors and their streams.
_STREAMS: dict[Key, tuple[str, str]] = {
    (stream.depth, 0): ("depth", "image_rect_raw"),
    (stream.infrared, 1): ("infra1", "image_rect_raw"),
    (stream.infrared, 2): ("infra2", "image_rect_raw"),
    (stream.color, 0): ("color", "image_raw"),
}
_DEPTH, _LEFT, _RIGHT = (stream.depth, 0), (stream.infrared, 1), (stream.infrared, 2)
_ENCODINGS = {
    format.z16: "16UC1", format.y8: "mono8", format.rgb8: "rgb8", format.bgr8: "bgr8", format.rgba8: "rgba8",
    format.bgra8: "bgra8",
}  # fmt: skip
_NODE = "/camera/camera"
_BASE_FRAME = "camera_link"
_DEPTH_UNIT_M = 0.001  # unit of 16UC1 (REP 118)
_OPTICAL_XYZW = (-0.5, 0.5, -0.5, 0.5)  # from x forward, y left, z up to x right, y down, z forward
# Messages of realsense2_camera_msgs, which ROS itself does not have.
_OWN_TYPES = {
    "realsense2_camera_msgs/msg/Extrinsics": "float64[9] rotation\nfloat64[3] translation",
    "realsense2_camera_msgs/msg/Metadata": "std_msgs/Header header\nstring json_data",
}


# Quality of service, reliable for all: how many messages are kept, and whether a late subscriber gets the last one.
_IMAGE, _INFO, _LATCHED = (1, False), (10, False), (1, True)
Published = tuple[str, str, Any, int, int, bool]  # topic, kind, message, nanoseconds, messages kept, is it latched


def _published(frames: composite_frame, is_first: bool, make: Callable[..., Any]) -> Iterator[Published]:
    """Yields a frameset's messages. is_first: also yields the streams' extrinsics, which are published once. make(kind,
    **fields) makes a message, such as of kind sensor_msgs/msg/Image, with arrays as NumPy arrays. Raises ValueError for
    a format without an encoding."""
    own = {(one.profile.stream_type(), one.profile.stream_index()): one for one in frames}
    streams = {key: own[key] for key in _STREAMS if key in own}
    if is_first:
        yield from _places({key: one.profile for key, one in streams.items()}, make)
    for key, one in streams.items():
        name, image_topic = _STREAMS[key]
        topic, time_ns, profile = f"{_NODE}/{name}", round(1e6 * one.timestamp), one.profile
        header = header_message(make, time_ns, _axes(name))
        # 1. The image.
        if profile.format() not in _ENCODINGS:
            known = " or ".join(one.name for one in _ENCODINGS)
            told = f"{profile.stream_name()} is {profile.format().name}, which has no ROS encoding"
            raise ValueError(f"{told}: use {known}")
        pixels = one.get_data()
        if profile.stream_type() == stream.depth and one.unit_m != _DEPTH_UNIT_M:
            pixels = np.clip(np.rint(pixels * (one.unit_m / _DEPTH_UNIT_M)), 0, 65535).astype(np.uint16)
        message = image_message(make, header, pixels, _ENCODINGS[profile.format()])
        yield f"{topic}/{image_topic}", "sensor_msgs/msg/Image", message, time_ns, *_IMAGE
        # 2. The camera. The right camera's P contains the baseline, in the left camera's frame.
        lens, info_header, tx, ty = profile.get_intrinsics(), header, 0.0, 0.0
        if key == _RIGHT and _LEFT in streams:
            there = profile.get_extrinsics_to(streams[_LEFT].profile).translation
            tx, ty = 0.0 - lens.fx * there[0], 0.0 - lens.fy * there[1]
            info_header = header_message(make, time_ns, _axes(_STREAMS[_LEFT][0]))
        k = np.array([[lens.fx, 0, lens.ppx], [0, lens.fy, lens.ppy], [0, 0, 1]], np.float64)
        message = camera_info_message(make, info_header, lens.height, lens.width, k, lens.coeffs, tx, ty)
        yield f"{topic}/camera_info", "sensor_msgs/msg/CameraInfo", message, time_ns, *_INFO
        # 3. The metadata.
        facts: dict[str, object] = {
            "frame_number": one.frame_number,
            "clock_domain": timestamp_domain.hardware_clock.name,
            "frame_timestamp": one.timestamp,
        }
        for which, value in sorted(one.metadata.items()):
            facts["hw_timestamp" if which == frame_metadata_value.frame_timestamp else which.name] = value
        kind = "realsense2_camera_msgs/msg/Metadata"
        message = make(kind, header=header, json_data=json.dumps(facts, separators=(",", ":")))
        yield f"{topic}/metadata", kind, message, time_ns, *_INFO


def _axes(name: str) -> str:
    return f"camera_{name}_optical_frame"


def _places(profiles: dict[Key, video_stream_profile], make: Callable[..., Any]) -> Iterator[Published]:
    """Yields messages of the extrinsics from depth to each other stream, and of the tree of frames below camera_link,
    the depth camera's frame."""
    from scipy.spatial.transform import Rotation

    base = profiles.get(_DEPTH)
    if base is None:
        return
    tree, optical = [], Rotation.from_quat(_OPTICAL_XYZW)
    for key, profile in profiles.items():
        name = _STREAMS[key][0]
        if key != _DEPTH:
            kind, there = "realsense2_camera_msgs/msg/Extrinsics", base.get_extrinsics_to(profile)
            message = make(kind, rotation=np.array(there.rotation), translation=np.array(there.translation))
            yield f"{_NODE}/extrinsics/depth_to_{name}", kind, message, 0, *_LATCHED
        # The place of optical axes in x forward, y left, z up: translation, and quaternion x y z w with w >= 0.
        there = profile.get_extrinsics_to(base)
        x, y, z = there.translation
        turn = (optical * Rotation.from_matrix(there.matrix()[:3, :3]) * optical.inv()).as_quat()
        place, turned = ((z, -x, -y), turn if turn[3] >= 0.0 else -turn), ((0.0, 0.0, 0.0), _OPTICAL_XYZW)
        for body in [f"camera_{name}_frame"] + [f"camera_aligned_depth_to_{name}_frame"] * (key == _LEFT):
            for parent, child, (translation, rotation) in ((_BASE_FRAME, body, place), (body, _axes(name), turned)):
                offset = make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, translation), strict=True)))
                quaternion = dict(zip("xyzw", map(float, rotation), strict=True))
                rotated = make("geometry_msgs/msg/Quaternion", **quaternion)
                moved = make("geometry_msgs/msg/Transform", translation=offset, rotation=rotated)
                fields = {"header": header_message(make, 0, parent), "child_frame_id": child, "transform": moved}
                tree.append(make("geometry_msgs/msg/TransformStamped", **fields))
    kind = "tf2_msgs/msg/TFMessage"
    yield "/tf_static", kind, make(kind, transforms=tree), 0, *_LATCHED


def write_topics(path: str | Path, frames: Iterable[composite_frame]) -> int:
    """Writes framesets as topics into the new folder `path`, as `ros2 bag record` does, and returns their number.
    Raises ImportError if rosbags is missing; raises ValueError for a format that has no encoding."""
    count = 0
    with McapFile(path, _OWN_TYPES) as file:
        for frameset in frames:
            for one in _published(frameset, not count, file.make):
                file.write(*one)
            count += 1
    return count
