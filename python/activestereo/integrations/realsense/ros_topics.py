# SPDX-License-Identifier: Apache-2.0
"""Framesets as topics of ROS 2's realsense2_camera in an MCAP file, by the package rosbags (pip install rosbags)."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.integrations.realsense.enums import format, stream
from activestereo.integrations.realsense.frames import composite_frame, frame
from activestereo.integrations.realsense.geometry import extrinsics
from activestereo.integrations.realsense.profiles import video_stream_profile

# realsense2_camera's names: topic below /camera/camera, image's name, frame of the optical axes.
_TOPICS = {
    (stream.depth, 0): ("depth", "image_rect_raw", "camera_depth_optical_frame"),
    (stream.infrared, 1): ("infra1", "image_rect_raw", "camera_infra1_optical_frame"),
    (stream.infrared, 2): ("infra2", "image_rect_raw", "camera_infra2_optical_frame"),
    (stream.color, 0): ("color", "image_raw", "camera_color_optical_frame"),
}
_ENCODINGS = {format.z16: "16UC1", format.y8: "mono8", format.rgb8: "rgb8", format.bgr8: "bgr8"}
_NAMESPACE = "/camera/camera"
_DEPTH_UNIT_M = 0.001  # of 16UC1 (REP 118)


def write_topics(path: str | Path, frames: Iterable[composite_frame]) -> int:
    """Writes images, camera_info and extrinsics of framesets into the folder `path`, which must not exist; returns how
    many framesets there were. ImportError where rosbags is missing; ValueError for a format that has no encoding."""
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise ImportError("rosbags is missing: pip install rosbags") from error
    store, count = get_typestore(Stores.ROS2_HUMBLE), 0
    with Writer(Path(path), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = _Topics(writer, store)
        for frameset in frames:
            profiles = {(f.profile.stream_type(), f.profile.stream_index()): f.profile for f in frameset}
            if not count:
                topics.extrinsics(profiles)
            for one in frameset:
                topics.image(one, profiles)
            count += 1
    return count


class _Topics:
    def __init__(self, writer: Any, store: Any) -> None:
        self._writer, self._store, self._types = writer, store, store.types
        self._connections: dict[str, Any] = {}

    def image(self, one: frame, profiles: dict[tuple[stream, int], video_stream_profile]) -> None:
        """An image and its camera_info, both at the frame's time."""
        key = one.profile.stream_type(), one.profile.stream_index()
        topic, name, axes = _TOPICS[key]
        encoding = _ENCODINGS.get(one.profile.format())
        if encoding is None:
            raise ValueError(f"{one.profile.stream_name()} is {one.profile.format().name}, which has no ROS encoding")
        time_ns = round(1e6 * one.timestamp)
        pixels = one.get_data()
        if key[0] == stream.depth and one.unit_m != _DEPTH_UNIT_M:
            pixels = np.clip(np.rint(pixels * (one.unit_m / _DEPTH_UNIT_M)), 0, 65535).astype(np.uint16)
        header = self._header(time_ns, axes)
        step = pixels.shape[1] * pixels[0, 0].nbytes
        data = np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8)
        image = self._types["sensor_msgs/msg/Image"](header, *pixels.shape[:2], encoding, 0, step, data)
        self._write(f"{_NAMESPACE}/{topic}/{name}", "sensor_msgs/msg/Image", image, time_ns)
        info = self._camera_info(header, one.profile, _baseline_m(key, profiles))
        self._write(f"{_NAMESPACE}/{topic}/camera_info", "sensor_msgs/msg/CameraInfo", info, time_ns)

    def extrinsics(self, profiles: dict[tuple[stream, int], video_stream_profile]) -> None:
        """realsense2_camera's extrinsics from depth, as transforms of camera_link's optical frames."""
        depth = profiles.get((stream.depth, 0))
        if depth is None:
            return
        Vector, Quaternion = (self._types[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Quaternion"))
        transforms = []
        for key, profile in profiles.items():
            if key == (stream.depth, 0):
                continue
            there = extrinsics.of(np.linalg.inv(depth.get_extrinsics_to(profile).matrix()))
            place = self._types["geometry_msgs/msg/Transform"](Vector(*there.translation), Quaternion(*_turn(there)))
            header = self._header(0, _TOPICS[stream.depth, 0][2])
            transforms.append(self._types["geometry_msgs/msg/TransformStamped"](header, _TOPICS[key][2], place))
        message = self._types["tf2_msgs/msg/TFMessage"](transforms)
        self._write("/tf_static", "tf2_msgs/msg/TFMessage", message, 0)

    def _header(self, time_ns: int, axes: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
        return self._types["std_msgs/msg/Header"](stamp=stamp, frame_id=axes)

    def _camera_info(self, header: Any, profile: video_stream_profile, baseline_m: float) -> Any:
        lens = profile.intrinsics
        k = np.array([lens.fx, 0, lens.ppx, 0, lens.fy, lens.ppy, 0, 0, 1.0])
        p = np.array([lens.fx, 0, lens.ppx, -lens.fx * baseline_m, 0, lens.fy, lens.ppy, 0, 0, 0, 1.0, 0])
        region = self._types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        d, r = np.array(lens.coeffs, float), np.eye(3).ravel()
        made = self._types["sensor_msgs/msg/CameraInfo"]
        return made(header, lens.height, lens.width, "plumb_bob", d, k, r, p, 0, 0, region)

    def _write(self, topic: str, kind: str, message: Any, time_ns: int) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(self._connections[topic], time_ns, self._store.serialize_cdr(message, kind))


def _baseline_m(key: tuple[stream, int], profiles: dict[tuple[stream, int], video_stream_profile]) -> float:
    if key != (stream.infrared, 2):
        return 0.0
    return -profiles[key].left_to_stream[0, 3]


def _turn(of: extrinsics) -> tuple[float, float, float, float]:
    """x, y, z, w."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(of.matrix()[:3, :3]).as_quat()
    return float(x), float(y), float(z), float(w)
