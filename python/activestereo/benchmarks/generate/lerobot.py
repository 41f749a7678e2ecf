# SPDX-License-Identifier: Apache-2.0
"""Writes a data set in LeRobot's format with depth (pip install 'lerobot[dataset]', 0.6 or later), which
LeRobotDataset(name, root=DIR/lerobot) reads. Depth maps are LeRobot's (huggingface/lerobot#3644): uint16 millimetres of
one channel, marked `is_depth_map`, kept as images without loss. Frames are independent, so each is an episode. Its
state is the RGB camera's pose: position in metres and a quaternion x, y, z, w. rgb_k is the camera's matrix, row by
row."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from activestereo.benchmarks.generate.bop import FRAMES_PER_S, stored_frames
from activestereo.common.optional import imported

_STATE = ("x", "y", "z", "qx", "qy", "qz", "qw")


def library() -> Any:
    """Imports and returns LeRobot's module of data sets. Raises ImportError, with the command to install it."""
    missing = "lerobot is missing: pip install 'lerobot[dataset]', which needs Python 3.12"
    return imported("lerobot.datasets.lerobot_dataset", missing)


def write_lerobot(out: Path, count: int) -> None:
    """Writes frames 0 to count - 1 of the data set `out` into the folder out/lerobot, which is written completely or
    not at all, and replaces an old one."""
    aside = out / ".unfinished"
    shutil.rmtree(aside, ignore_errors=True)
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
            data = library().LeRobotDataset.create(
                f"activestereo/{out.name}", FRAMES_PER_S, features, root=aside, robot_type="camera", use_videos=False
            )
        pose = frame.camera_to_world
        state = np.concatenate([pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat()]).astype(np.float32)
        k = frame.k.ravel().astype(np.float32)
        data.add_frame(images | {"observation.state": state, "observation.rgb_k": k, "task": "things on a table"})
        data.save_episode()
    data.finalize()
    shutil.rmtree(out / "lerobot", ignore_errors=True)
    aside.rename(out / "lerobot")
