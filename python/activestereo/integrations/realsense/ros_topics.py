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

from activestereo.common.mcap_file import McapFile
from activestereo.integrations.realsense.frames import composite_frame
from activestereo.integrations.realsense.ros_messages import OWN_TYPES, Published, published


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
