# SPDX-License-Identifier: Apache-2.0
"""Writes a data set in other formats, each by its own library.

LeRobot's format with depth (pip install 'lerobot[dataset]', 0.6 or later), LeRobotDataset(name, root=DIR/lerobot).
Depth maps are LeRobot's (huggingface/lerobot#3644): uint16 millimetres of one channel, marked `is_depth_map`, kept as
images without loss. Frames are independent, so each is an episode. Its state is the RGB camera's pose: position in
metres and a quaternion x, y, z, w. rgb_k is the camera's matrix, row by row.

Messages of ROS 2 in an MCAP file, DIR/mcap (pip install rosbags). Topics have a RealSense camera's names: color,
aligned depth (16UC1, millimetres: REP 118) and the infrared pair, each with its camera_info; /camera/pose is the RGB
camera's pose. Axes are those of REP 103's optical frames.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from activestereo.benchmarks.generate.bop import FRAMES_PER_S, Stored, stored_frames
from activestereo.common.input_files import read_json
from activestereo.common.optional import imported

_STATE = ("x", "y", "z", "qx", "qy", "qz", "qw")
# {format: (module of its package, what to say if it is missing)}.
_PACKAGES = {
    "lerobot": (
        "lerobot.datasets.lerobot_dataset",
        "lerobot is missing: pip install 'lerobot[dataset]', which needs Python 3.12",
    ),
    "mcap": ("rosbags", "rosbags is missing: pip install rosbags"),
}


def write_lerobot(out: Path, count: int, to: Path) -> None:
    """Writes frames 0 to count - 1 of the data set `out` into the folder `to`, which must not exist."""
    data: Any = None
    pictures: dict[str, Any]
    for frame in stored_frames(out, count):
        pictures = {"rgb": frame.rgb}
        for side, image in (("ir_left", frame.ir_left), ("ir_right", frame.ir_right)):
            counts = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
            pictures[side] = np.repeat(counts[..., None], 3, axis=2)
        for name, depth_mm in (("depth", frame.depth_mm), ("depth_true", frame.depth_true_mm)):
            pictures[name] = depth_mm[..., None].astype(np.uint16)
        images = {f"observation.images.{name}": image for name, image in pictures.items()}
        if data is None:
            features: dict[str, Any] = {
                name: {"dtype": "image", "shape": image.shape, "names": ["height", "width", "channels"]}
                | ({"info": {"is_depth_map": True}} if image.shape[2] == 1 else {})
                for name, image in images.items()
            }
            features["observation.state"] = {"dtype": "float32", "shape": (len(_STATE),), "names": list(_STATE)}
            features["observation.rgb_k"] = {"dtype": "float32", "shape": (9,), "names": None}
            data = imported(*_PACKAGES["lerobot"]).LeRobotDataset.create(
                f"activestereo/{out.name}", FRAMES_PER_S, features, root=to, robot_type="camera", use_videos=False
            )
        pose = frame.camera_to_world
        state = np.concatenate([pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat()]).astype(np.float32)
        k = frame.k.ravel().astype(np.float32)
        data.add_frame(images | {"observation.state": state, "observation.rgb_k": k, "task": "things on a table"})
        data.save_episode()
    if data is not None:
        data.finalize()


_COLOR = "camera_color_optical_frame"


def write_mcap(out: Path, count: int, to: Path) -> None:
    """Writes frames 0 to count - 1 of the data set `out` into the folder `to`, which must not exist: one .mcap file and
    its metadata, as `ros2 bag record` writes them. All topics are reliable, and their queues keep one message."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, infrared = get_typestore(Stores.ROS2_HUMBLE), read_json(out / "ir_cameras.json")
    connections: dict[str, Any] = {}
    never = QosTime(9223372036, 854775807)  # an infinite duration, as a recording stores it
    kept = QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.VOLATILE
    quality = Qos(*kept, never, never, QosLiveliness.AUTOMATIC, never, False)

    def make(kind: str, **fields: Any) -> Any:
        return store.types[kind](**fields)

    with Writer(to, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for frame in stored_frames(out, count):
            time_ns = frame.number * 10**9 // FRAMES_PER_S
            stamp = make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
            for topic, kind, axes, fields in _messages(make, frame, infrared):
                if topic not in connections:
                    options = {"typestore": store, "offered_qos_profiles": [quality]}
                    connections[topic] = writer.add_connection(topic, kind, **options)
                message = make(kind, header=make("std_msgs/msg/Header", stamp=stamp, frame_id=axes), **fields)
                writer.write(connections[topic], time_ns, store.serialize_cdr(message, kind))


def _messages(
    make: Callable[..., Any], frame: Stored, infrared: dict[str, Any]
) -> Iterator[tuple[str, str, str, dict[str, Any]]]:
    """Yields (topic, type, axes, fields without the header) of each of a frame's messages. make(type, **fields): makes
    a message."""
    left, right, color = infrared["ir_left"], infrared["ir_right"], {"cam_K": frame.k, "distortion": [0.0] * 5}
    tx = -float(right["cam_K"][0]) * float(infrared["baseline_m"])  # of a right camera's P, pixels times metres
    gray = "mono8" if frame.ir_left.dtype == np.uint8 else "mono16"
    streams: tuple[tuple[Any, ...], ...] = (
        ("color", "image_raw", frame.rgb, "rgb8", _COLOR, color, 0.0),
        ("aligned_depth_to_color", "image_raw", frame.depth_mm.astype(np.uint16), "16UC1", _COLOR, color, 0.0),
        ("infra1", "image_rect_raw", frame.ir_left, gray, "camera_infra1_optical_frame", left, 0.0),
        ("infra2", "image_rect_raw", frame.ir_right, gray, "camera_infra2_optical_frame", right, tx),
    )
    for name, image, pixels, encoding, axes, camera, shift in streams:
        size = {"height": pixels.shape[0], "width": pixels.shape[1]}
        data = np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8)
        rows = {"encoding": encoding, "is_bigendian": 0, "step": data.size // pixels.shape[0], "data": data}
        yield f"/camera/{name}/{image}", "sensor_msgs/msg/Image", axes, size | rows
        k, d = np.reshape(np.array(camera["cam_K"], np.float64), (3, 3)), np.array(camera["distortion"], np.float64)
        lens = {"distortion_model": "plumb_bob", "d": d, "k": k.ravel(), "r": np.eye(3).ravel()}
        lens |= {"p": np.hstack([k, [[shift], [0.0], [0.0]]]).ravel(), "binning_x": 0, "binning_y": 0}
        whole = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        lens["roi"] = make("sensor_msgs/msg/RegionOfInterest", **whole)
        yield f"/camera/{name}/camera_info", "sensor_msgs/msg/CameraInfo", axes, size | lens
    turn = map(float, Rotation.from_matrix(frame.camera_to_world[:3, :3]).as_quat())
    place = map(float, frame.camera_to_world[:3, 3])
    pose = make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", **dict(zip("xyz", place, strict=True))),
        orientation=make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turn, strict=True))),
    )
    yield "/camera/pose", "geometry_msgs/msg/PoseStamped", "world", {"pose": pose}


FORMATS = {"lerobot": write_lerobot, "mcap": write_mcap}


def require_formats(names: list[str]) -> None:
    """Raises ImportError, with the packages to install, if a format's package is missing."""
    for name in names:
        imported(*_PACKAGES[name])


def write_formats(out: Path, count: int, names: list[str]) -> None:
    """Writes frames 0 to count - 1 of the data set `out` in each named format, into the folder out/NAME. A folder is
    written completely or not at all, and replaces an old one."""
    aside = out / ".unfinished"
    shutil.rmtree(aside, ignore_errors=True)
    aside.mkdir()
    for name in names:
        FORMATS[name](out, count, aside / name)
        shutil.rmtree(out / name, ignore_errors=True)
        (aside / name).rename(out / name)
    aside.rmdir()
