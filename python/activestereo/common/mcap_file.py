# SPDX-License-Identifier: Apache-2.0
"""Writes ROS 2 messages of images and their cameras into an MCAP file with rosbags (pip install rosbags), as
`ros2 bag record` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from activestereo.common.optional import imported

ROSBAGS = "rosbags", "rosbags is missing: pip install rosbags"


def header_message(make: Callable[..., Any], time_ns: int, axes: str) -> Any:
    """Makes a std_msgs/msg/Header. axes: the frame_id. make(type, **fields): makes a message."""
    stamp = make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=axes)


def image_message(make: Callable[..., Any], header: Any, pixels: NDArray[Any], encoding: str) -> Any:
    """Makes a sensor_msgs/msg/Image of pixels [height, width(, channels)]. make: as in
    header_message()."""
    return make(
        "sensor_msgs/msg/Image",
        header=header,
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=pixels.shape[1] * pixels[0, 0].nbytes,
        data=np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8),
    )


def camera_info_message(
    make: Callable[..., Any], header: Any, height: int, width: int, k: NDArray[np.float64], distortion: ArrayLike,
    tx: float = 0.0, ty: float = 0.0,
) -> Any:  # fmt: skip
    """Makes a sensor_msgs/msg/CameraInfo. k: [3, 3], pixels. distortion: k1 k2 p1 p2 k3. tx, ty: the last column of P,
    pixels times metres; for a right camera tx is minus the focal length times the baseline. make: as in
    header_message()."""
    region = make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header,
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.array(distortion, np.float64),
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.hstack([k, [[tx], [ty], [0.0]]]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=region,
    )


class McapFile:
    """Writes a recording: a folder with one .mcap file and its metadata. Use it as a context manager. path: the folder,
    which must not exist. own_types: {message type: its definition as .msg text} of types that ROS lacks. Raises
    ImportError if rosbags is missing."""

    def __init__(self, path: str | Path, own_types: Mapping[str, str] | None = None) -> None:
        imported(*ROSBAGS)
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self._store = get_typestore(Stores.ROS2_HUMBLE)
        for kind, text in (own_types or {}).items():
            self._store.register(get_types_from_msg(text, kind))
        self._writer = Writer(Path(path), version=9, storage_plugin=StoragePlugin.MCAP)
        self._connections: dict[str, Any] = {}

    def __enter__(self) -> McapFile:
        self._writer.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.__exit__(*error)

    def make(self, kind: str, **fields: Any) -> Any:
        """Makes a message of a type such as sensor_msgs/msg/Image; array fields are NumPy arrays."""
        return self._store.types[kind](**fields)

    def write(
        self, topic: str, kind: str, message: Any, time_ns: int, depth: int = 1, is_latched: bool = False
    ) -> None:
        """Writes a message to a topic. depth, is_latched: the topic's quality of service, fixed by its first message:
        how many messages a queue keeps, and whether late subscribers get the last one. All topics are reliable."""
        from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

        if topic not in self._connections:
            durability = QosDurability.TRANSIENT_LOCAL if is_latched else QosDurability.VOLATILE
            never = QosTime(9223372036, 854775807)  # an infinite duration, as a recording stores it
            kept = QosHistory.KEEP_LAST, depth, QosReliability.RELIABLE, durability
            quality = Qos(*kept, never, never, QosLiveliness.AUTOMATIC, never, False)
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=[quality]
            )
        self._writer.write(self._connections[topic], time_ns, self._store.serialize_cdr(message, kind))
