# SPDX-License-Identifier: Apache-2.0
"""Lists the entries that the page can open: one file or folder, or all captures, scenes and pictures below a folder.
Infrared pairs without calibration become a capture with a preset's cameras and no scene."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.camera.plan import ir_intrinsics
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Camera, Capture, Frame, Projector, Rig, read_camera, read_hints
from activestereo.capture.capture_json import JsonObject
from activestereo.capture.images import image_size, read_gray
from activestereo.capture.importers.realsense_folder import frame_files
from activestereo.common.pose import camera_to_camera
from activestereo.scene_io import OWN_ENDINGS, USD_ENDINGS

_SCENE_ENDINGS = (*OWN_ENDINGS, *USD_ENDINGS)
CAPTURE_FILE = "capture.json"
# The deepest level that is searched, and the most entries that are listed.
_DEEPEST, _MOST = 3, 500
SIDES = ("ir_left", "ir_right")
# A Capture needs a scene path. A capture of pictures has no scene, and this path is never read.
_NONE = Path("none")


class Library:
    """Lists what the page can open below `root`, by relative paths; "." is root itself. make(path): opens a capture,
    scene or folder of pictures as the page's source; raises ValueError or OSError if it cannot."""

    def __init__(self, root: Path, make: Callable[[Path], Any]) -> None:
        if not root.exists():
            raise ValueError(f"{root}: there is no such file or folder")
        root = root.parent if root.name == CAPTURE_FILE else root
        self.root, self._make = root, make
        self._open: dict[str, Any] = {}
        self._one_at_a_time = threading.Lock()
        self.names = [str(path.relative_to(root)) for path in _entries(root)]
        if not self.names:
            scenes = " ".join(_SCENE_ENDINGS)
            raise ValueError(f"{root}: holds neither a capture ({CAPTURE_FILE}) nor a scene ({scenes})")

    def source(self, name: Any) -> Any:
        """Returns an entry's source, which stays open until another entry is asked for. Raises ValueError for a name
        that is not listed."""
        if not isinstance(name, str) or name not in self.names:
            raise ValueError("there is no such entry, or it lies outside of the folder that is shown")
        with self._one_at_a_time:
            if name not in self._open:
                self._open = {name: self._make(self.root / name)}  # only one is kept open, because scenes take memory
            return self._open[name]


def is_capture(path: Path) -> bool:
    return (path / CAPTURE_FILE).is_file()


def is_scene(path: Path) -> bool:
    return path.suffix.lower() in _SCENE_ENDINGS and path.is_file()


def _is_entry(path: Path) -> bool:
    """Returns whether the page can open a path: a capture, a scene, or a folder of infrared pairs, named as simulate or
    a data set names them."""
    return (
        is_capture(path)
        or is_scene(path)
        or all((path / f"{side}.png").is_file() for side in SIDES)
        or all((path / side).is_dir() for side in SIDES)
    )


def _entries(root: Path) -> list[Path]:
    if _is_entry(root):
        return [root]
    found = list(islice(_below(root, _DEEPEST), _MOST))
    # A folder of any other kind is taken for a recording; if it is none, the reader's error names the missing part.
    return found if found or not root.is_dir() else [root]


def _below(folder: Path, depth: int) -> Iterator[Path]:
    """Yields the captures, scenes and picture folders up to `depth` levels below a folder, in order of their names. It
    follows no links and does not look into captures."""
    if depth == 0 or not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        if path.is_symlink() or path.name.startswith("."):
            continue
        if _is_entry(path):
            yield path
        elif path.is_dir():
            yield from _below(path, depth - 1)


def pictures_capture(folder: Path, config: StereoDepthSensorConfig) -> Capture:
    """Returns a capture of all infrared pairs in a folder. Its cameras are those that a file of `simulate` or
    `generate` there states. config: gives the cameras if there is no such file, resized to the images. Raises
    ValueError without pairs."""
    pairs = _pairs(folder)
    size, bits = image_size(pairs[0][0]), 8 * read_gray(pairs[0][0]).dtype.itemsize
    frames = tuple(
        Frame(number, *pair, 0.0, config.ir_camera_exposure, np.eye(4), "train") for number, pair in enumerate(pairs)
    )
    nowhere = Projector(_NONE, np.eye(3), np.eye(4))
    folders = (folder, *folder.absolute().parents[:2])  # a data set has ir_cameras.json two levels up
    files = [folder / "camera.json", *(parent / "ir_cameras.json" for parent in folders)]
    if own := next((path for path in files if path.is_file()), None):
        root = JsonObject.read(own)
        cameras = root.object("cameras") if root.has("cameras") else root
        left, right = (cameras.object(side) for side in SIDES)
        left_to_rgb, right_to_rgb = (side.rigid_transform("camera_to_rgb") for side in (left, right))
        left_to_right = np.linalg.inv(right_to_rgb) @ left_to_rgb
        rig = Rig(read_camera(left), read_camera(right), left_to_right, nowhere, bits)
        title = f"{folder.name}, with the cameras of {own.name}"
        return Capture(folder, title, _NONE, rig, frames, read_hints(root))
    if size != config.ir_resolution:
        scaled = config.scaled(size[0] / config.ir_resolution[0])
        config = scaled if scaled.ir_resolution == size else config.resized(*size)
    left, right = (
        Camera(*size, *(np.array(part) for part in ir_intrinsics(config, is_right))) for is_right in (False, True)
    )
    left_to_right = camera_to_camera(config.trans_pose_l, config.trans_pose_r)
    rig = Rig(left, right, left_to_right, nowhere, bits)
    title = f"{folder.name}, with the nominal figures of the {config.model}"
    return Capture(folder, title, _NONE, rig, frames, {"max_disparity": config.max_disparity})


def _pairs(folder: Path) -> list[tuple[Path, Path]]:
    left, right = (folder / f"{side}.png" for side in SIDES)
    if left.is_file() and right.is_file():
        return [(left, right)]
    left, right = (folder / side for side in SIDES)
    if left.is_dir() and right.is_dir():
        both = [(path, right / path.name) for path in sorted(left.glob("*.png")) if (right / path.name).is_file()]
        if not both:
            raise ValueError(f"{folder}: {SIDES[0]} and {SIDES[1]} hold no images of the same names")
        return both
    return [(entry.files["left"], entry.files["right"]) for entry in frame_files(folder)]
