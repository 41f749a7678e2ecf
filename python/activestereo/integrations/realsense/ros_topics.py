# SPDX-License-Identifier: Apache-2.0
"""Framesets as messages and topics of ROS 2's realsense2_camera 4.5x: into an MCAP file by rosbags (pip install
rosbags), and live by rclpy, which ROS 2 has.

Names, frames and fields are those of its ros2-development branch (github.com/IntelRealSense/realsense-ros), qualities
of service those that the recording in its issue 3472 lists for the topics it holds, and alike for the others."""

from __future__ import annotations

import array
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from activestereo.common.mcap_file import McapFile
from activestereo.common.ros_images import camera_info_message, image_message
from activestereo.integrations.realsense.enums import format, frame_metadata_value, stream, timestamp_domain
from activestereo.integrations.realsense.frames import composite_frame, extrinsics, frame, video_stream_profile

Key = tuple[stream, int]
# In the order of the device's sensors and their streams: the stream's name, and its image's.
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
OWN_TYPES = {
    "realsense2_camera_msgs/msg/Extrinsics": "float64[9] rotation\nfloat64[3] translation",
    "realsense2_camera_msgs/msg/Metadata": "std_msgs/Header header\nstring json_data",
}


@dataclass(frozen=True)
class Quality:
    """Quality of service: how many messages are kept, and whether who comes late gets the last; all are reliable."""

    depth: int
    is_latched: bool = False


IMAGE, INFO, LATCHED = Quality(1), Quality(10), Quality(1, is_latched=True)


class Maker(Protocol):
    """Makes a message of a kind such as sensor_msgs/msg/Image from its fields; arrays are NumPy's."""

    def __call__(self, kind: str, **fields: Any) -> Any: ...


@dataclass(frozen=True)
class Published:
    topic: str
    kind: str
    message: Any
    time_ns: int
    quality: Quality


def published(frames: composite_frame, is_first: bool, make: Maker) -> Iterator[Published]:
    """A frameset's messages; the first one also gets the streams' places, which are published once. Raises ValueError
    for a format without an encoding."""
    own = {(one.profile.stream_type(), one.profile.stream_index()): one for one in frames}
    streams = {key: own[key] for key in _STREAMS if key in own}
    if is_first:
        yield from _places({key: one.profile for key, one in streams.items()}, make)
    for key, one in streams.items():
        name, image = _STREAMS[key]
        time_ns, header = round(1e6 * one.timestamp), _header(one, _axes(name), make)
        topic = f"{_NODE}/{name}"
        yield Published(f"{topic}/{image}", "sensor_msgs/msg/Image", _image(one, header, make), time_ns, IMAGE)
        left = streams[_LEFT].profile if key == _RIGHT and _LEFT in streams else None
        info = _camera_info(one, left, header, make)
        yield Published(f"{topic}/camera_info", "sensor_msgs/msg/CameraInfo", info, time_ns, INFO)
        kind = "realsense2_camera_msgs/msg/Metadata"
        message = make(kind, header=header, json_data=_metadata_text(one))
        yield Published(f"{topic}/metadata", kind, message, time_ns, INFO)


def _axes(name: str) -> str:
    return f"camera_{name}_optical_frame"


def _stamp(time_ns: int, make: Maker) -> Any:
    return make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)


def _header(one: frame, axes: str, make: Maker) -> Any:
    return make("std_msgs/msg/Header", stamp=_stamp(round(1e6 * one.timestamp), make), frame_id=axes)


def _image(one: frame, header: Any, make: Maker) -> Any:
    encoding = _ENCODINGS.get(one.profile.format())
    if encoding is None:
        raise ValueError(f"{one.profile.stream_name()} is {one.profile.format().name}, which has no ROS encoding")
    pixels = one.get_data()
    if one.profile.stream_type() == stream.depth and one.unit_m != _DEPTH_UNIT_M:
        pixels = np.clip(np.rint(pixels * (one.unit_m / _DEPTH_UNIT_M)), 0, 65535).astype(np.uint16)
    return image_message(make, header, pixels, encoding)


def _camera_info(one: frame, left: video_stream_profile | None, header: Any, make: Maker) -> Any:
    """left: of the right camera's image the left one's profile: P is then of the pair, in the left one's frame."""
    lens = one.profile.get_intrinsics()
    tx = ty = 0.0
    if left is not None:
        there = one.profile.get_extrinsics_to(left).translation
        tx, ty = 0.0 - lens.fx * there[0], 0.0 - lens.fy * there[1]
        header = _header(one, _axes(_STREAMS[_LEFT][0]), make)
    k = np.array([[lens.fx, 0, lens.ppx], [0, lens.fy, lens.ppy], [0, 0, 1]], np.float64)
    return camera_info_message(make, header, lens.height, lens.width, k, lens.coeffs, tx, ty)


def _metadata_text(one: frame) -> str:
    facts: dict[str, object] = {
        "frame_number": one.frame_number,
        "clock_domain": timestamp_domain.hardware_clock.name,
        "frame_timestamp": one.timestamp,
    }
    for which, value in sorted(one.metadata.items()):
        facts["hw_timestamp" if which == frame_metadata_value.frame_timestamp else which.name] = value
    return json.dumps(facts, separators=(",", ":"))


def _places(profiles: dict[Key, video_stream_profile], make: Maker) -> Iterator[Published]:
    """Depth's extrinsics to each other stream, and the frames' tree below camera_link, which is depth's."""
    base = profiles.get(_DEPTH)
    if base is None:
        return
    tree = []
    for key, profile in profiles.items():
        name = _STREAMS[key][0]
        if key != _DEPTH:
            kind, there = "realsense2_camera_msgs/msg/Extrinsics", base.get_extrinsics_to(profile)
            message = make(kind, rotation=np.array(there.rotation), translation=np.array(there.translation))
            yield Published(f"{_NODE}/extrinsics/depth_to_{name}", kind, message, 0, LATCHED)
        place = _in_ros_axes(profile.get_extrinsics_to(base))
        turned = (0.0, 0.0, 0.0), _OPTICAL_XYZW
        for body in [f"camera_{name}_frame"] + [f"camera_aligned_depth_to_{name}_frame"] * (key == _LEFT):
            tree += [_transform(_BASE_FRAME, body, *place, make), _transform(body, _axes(name), *turned, make)]
    kind = "tf2_msgs/msg/TFMessage"
    yield Published("/tf_static", kind, make(kind, transforms=tree), 0, LATCHED)


def _in_ros_axes(of: extrinsics) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(translation, x y z w) of optical axes' extrinsics in x forward, y left, z up."""
    from scipy.spatial.transform import Rotation

    optical = Rotation.from_quat(_OPTICAL_XYZW)
    x, y, z = of.translation
    turn = (optical * Rotation.from_matrix(of.matrix()[:3, :3]) * optical.inv()).as_quat()
    return (z, -x, -y), tuple(float(q) for q in (turn if turn[3] >= 0.0 else -turn))  # w >= 0


def _transform(
    parent: str, child: str, translation: tuple[float, ...], rotation: tuple[float, ...], make: Maker
) -> Any:
    header = make("std_msgs/msg/Header", stamp=_stamp(0, make), frame_id=parent)
    offset = make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, translation), strict=True)))
    turn = make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, rotation), strict=True)))
    place = make("geometry_msgs/msg/Transform", translation=offset, rotation=turn)
    return make("geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=place)


def write_topics(path: str | Path, frames: Iterable[composite_frame]) -> int:
    """Writes framesets into the folder `path`, which must not exist, as `ros2 bag record` does of the camera's topics;
    returns how many framesets there were. Raises ImportError if rosbags is missing; raises ValueError for a format that
    has no encoding."""
    count = 0
    with McapFile(path, OWN_TYPES) as file:
        for frameset in frames:
            for one in published(frameset, not count, file.make):
                quality = one.quality
                file.write(one.topic, one.kind, one.message, one.time_ns, quality.depth, quality.is_latched)
            count += 1
    return count


class TopicPublisher:
    """Publishes framesets on a node of rclpy. missing: topics whose message package this ROS lacks, such as
    realsense2_camera_msgs; they are left out. Raises ImportError without rclpy."""

    def __init__(self, node: Any) -> None:
        try:
            from rclpy import qos
        except ImportError as error:
            raise ImportError("rclpy is missing: source ROS 2's setup.bash") from error
        self._node, self._qos = node, qos
        self._publishers: dict[str, Any] = {}
        self.missing: set[str] = set()

    def publish(self, frames: composite_frame) -> None:
        """A frameset's messages; with the first one its streams' places."""
        for one in published(frames, not self._publishers, _message):
            if one.message is None:
                self.missing.add(one.topic)
                continue
            if one.topic not in self._publishers:
                kept = self._qos.DurabilityPolicy
                durability = kept.TRANSIENT_LOCAL if one.quality.is_latched else kept.VOLATILE
                profile = self._qos.QoSProfile(depth=one.quality.depth, durability=durability)
                self._publishers[one.topic] = self._node.create_publisher(type(one.message), one.topic, profile)
            self._publishers[one.topic].publish(one.message)


def _message(kind: str, **fields: Any) -> Any:
    """Makes a message of ROS' own Python packages; None if its package is missing."""
    package, _, name = kind.split("/")
    try:
        made = getattr(import_module(f"{package}.msg"), name)
    except ImportError:
        return None
    kinds = made.get_fields_and_field_types()
    for field, value in fields.items():
        if isinstance(value, np.ndarray) and kinds[field].startswith("sequence"):  # this field takes no NumPy array
            fields[field] = array.array(value.dtype.char, value.tobytes())
    return made(**fields)
