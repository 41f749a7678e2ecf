# SPDX-License-Identifier: Apache-2.0
"""Framesets as topics of ROS 2's realsense2_camera: into an MCAP file by rosbags (pip install rosbags), and live by
rclpy, which ROS 2 has."""

from __future__ import annotations

import array
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.integrations.realsense.frames import composite_frame
from activestereo.integrations.realsense.ros_messages import OWN_TYPES, Published, Quality, published


def write_topics(path: str | Path, frames: Iterable[composite_frame]) -> int:
    """Writes framesets into the folder `path`, which must not exist, as `ros2 bag record` does of the camera's topics;
    returns how many framesets there were. ImportError where rosbags is missing; ValueError for a format that has no
    encoding."""
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise ImportError("rosbags is missing: pip install rosbags") from error
    store, count = get_typestore(Stores.ROS2_HUMBLE), 0
    for kind, text in OWN_TYPES.items():
        store.register(get_types_from_msg(text, kind))

    def make(kind: str, **fields: Any) -> Any:
        return store.types[kind](**fields)

    connections: dict[str, Any] = {}
    with Writer(Path(path), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for frameset in frames:
            for one in published(frameset, not connections, make):
                if one.topic not in connections:
                    qualities = [_recorded_quality(one.quality)]
                    connections[one.topic] = writer.add_connection(
                        one.topic, one.kind, typestore=store, offered_qos_profiles=qualities
                    )
                writer.write(connections[one.topic], one.time_ns, store.serialize_cdr(one.message, one.kind))
            count += 1
    return count


def _recorded_quality(quality: Quality) -> Any:
    """As a recording keeps it; times are without end."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    durability = QosDurability.TRANSIENT_LOCAL if quality.is_latched else QosDurability.VOLATILE
    never = QosTime(9223372036, 854775807)
    kept = QosHistory.KEEP_LAST, quality.depth, QosReliability.RELIABLE, durability
    return Qos(*kept, never, never, QosLiveliness.AUTOMATIC, never, False)


class TopicPublisher:
    """Publishes framesets on a node of rclpy. missing: topics whose package of messages this ROS has not, such as
    realsense2_camera_msgs; they are left out. ImportError where rclpy is missing."""

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
            else:
                self._publisher(one).publish(one.message)

    def _publisher(self, one: Published) -> Any:
        if one.topic not in self._publishers:
            kept = self._qos.DurabilityPolicy
            durability = kept.TRANSIENT_LOCAL if one.quality.is_latched else kept.VOLATILE
            profile = self._qos.QoSProfile(depth=one.quality.depth, durability=durability)
            self._publishers[one.topic] = self._node.create_publisher(type(one.message), one.topic, profile)
        return self._publishers[one.topic]


def _message(kind: str, **fields: Any) -> Any:
    """A message of ROS' own Python packages; None where its package is missing."""
    package, _, name = kind.split("/")
    try:
        made = getattr(import_module(f"{package}.msg"), name)
    except ImportError:
        return None
    kinds = made.get_fields_and_field_types()
    for field, value in fields.items():
        if isinstance(value, np.ndarray) and kinds[field].startswith("sequence"):  # which takes no NumPy
            fields[field] = array.array(value.dtype.char, value.tobytes())
    return made(**fields)
