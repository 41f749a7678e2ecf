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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from activestereo.benchmarks.generate.bop import FRAMES_PER_S, Stored, stored_frames
from activestereo.common.input_files import read_json
from activestereo.common.mcap_file import ROSBAGS, McapFile, camera_info_message, header_message, image_message
from activestereo.common.optional import imported

_STATE = ("x", "y", "z", "qx", "qy", "qz", "qw")
# {format: (module of its package, what to say if it is missing)}.
_PACKAGES = {
    "lerobot": (
        "lerobot.datasets.lerobot_dataset",
        "lerobot is missing: pip install 'lerobot[dataset]', which needs Python 3.12",
    ),
    "mcap": ROSBAGS,
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
    """Writes frames 0 to count - 1 of the data set `out` into the folder `to`, which must not exist."""
    infrared = read_json(out / "ir_cameras.json")
    with McapFile(to) as file:
        for frame in stored_frames(out, count):
            _write_frame(file, frame, infrared)


def _write_frame(file: McapFile, frame: Stored, infrared: dict[str, Any]) -> None:
    time_ns = frame.number * 10**9 // FRAMES_PER_S
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
        header = header_message(file.make, time_ns, axes)
        message = image_message(file.make, header, pixels, encoding)
        file.write(f"{topic}/{image}", "sensor_msgs/msg/Image", message, time_ns)
        info = camera_info_message(file.make, header, pixels.shape[0], pixels.shape[1], k, distortion, tx)
        file.write(f"{topic}/camera_info", "sensor_msgs/msg/CameraInfo", info, time_ns)
    x, y, z, w = Rotation.from_matrix(frame.camera_to_world[:3, :3]).as_quat()
    at = dict(zip("xyz", map(float, frame.camera_to_world[:3, 3]), strict=True))
    pose = file.make(
        "geometry_msgs/msg/Pose",
        position=file.make("geometry_msgs/msg/Point", **at),
        orientation=file.make("geometry_msgs/msg/Quaternion", x=float(x), y=float(y), z=float(z), w=float(w)),
    )
    kind, header = "geometry_msgs/msg/PoseStamped", header_message(file.make, time_ns, "world")
    file.write("/camera/pose", kind, file.make(kind, header=header, pose=pose), time_ns)


def _lens(camera: dict[str, Any]) -> tuple[NDArray[np.float64], list[float]]:
    return np.reshape(np.array(camera["cam_K"], np.float64), (3, 3)), list(camera["distortion"])


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
