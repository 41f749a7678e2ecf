# SPDX-License-Identifier: Apache-2.0
"""Converts recordings of colour and depth without infrared images to captures, for the readers of TUM, Open3D and BOP
folders.

Depth lies on the colour image's pixels, as if one camera took both, unless the colour camera is stated. Baseline,
pattern and projector are the preset's nominal ones. Such a capture shows objects' places and depth to compare, but
neither noise nor dots."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Camera, Capture, ColorCamera, Frame, Projector, Rig
from activestereo.capture.images import image_size, read_color, read_gray
from activestereo.capture.importers.repeats import repeat_groups
from activestereo.capture.write import write_capture
from activestereo.common.limits import camera_matrix_fault


@dataclass(frozen=True)
class ColorDepthFrame:
    """The image files of one moment. depth_scale: metres per unit of the depth file. camera_to_world: 4x4, or None if
    unknown."""

    time_s: float
    depth: Path
    color: Path | None
    depth_scale: float
    camera_to_world: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class ColorDepthRecording:
    """A recording of colour and depth. K: 3x3 of both images, pixels. kind: name of the folder's layout. scene: a glTF
    file of the objects in view, or None. color: the colour camera, if depth does not lie on its pixels. assumed:
    messages on assumptions, for the user."""

    path: Path
    kind: str
    K: NDArray[np.float64]
    frames: tuple[ColorDepthFrame, ...]
    scene: Path | None = None
    color: ColorCamera | None = None
    assumed: tuple[str, ...] = ()


def camera_matrix_of(path: Path, key: str, values: object) -> NDArray[np.float64]:
    """Checks nine numbers, row by row, as a camera matrix and returns it as 3x3. Raises ValueError with file, key and
    value."""
    try:
        K = np.array(values, dtype=np.float64).reshape(3, 3)
    except (TypeError, ValueError):
        raise ValueError(f"{path}: {key}: is {values!r}, expected nine numbers") from None
    fault = camera_matrix_fault(K)
    if fault is not None:
        raise ValueError(f"{path}: {key}: {K.ravel().tolist()} {fault}")
    return K


def image_files(folder: Path) -> dict[str, Path]:
    """Lists a folder's PNG and JPEG files, {name without suffix: path}, in order of their paths."""
    files = [*folder.glob("*.png"), *folder.glob("*.jpg"), *folder.glob("*.jpeg")] if folder.is_dir() else []
    return {file.stem: file for file in sorted(files)}


def write_color_depth(
    recording: ColorDepthRecording, out: Path, baseline_m: float, projector: Projector, pattern: NDArray[np.uint8],
    scene: Path | None = None, progress: Callable[[float], None] | None = None,
) -> Capture:  # fmt: skip
    """Writes a recording as the capture `out`, which must not exist, and returns it. baseline_m, projector, pattern:
    the preset's. scene: a glTF file in place of the recording's. Raises ValueError with the file if sizes differ, depth
    has 8 bits or a file is damaged."""
    tell = progress or (lambda fraction: None)
    width, height = image_size(recording.frames[0].depth, "depth")
    color = recording.color or ColorCamera(width, height, recording.K)
    frames, depths, colors = [], {}, {}
    for number, entry in enumerate(recording.frames):
        depth = read_gray(entry.depth, (width, height), "depth")
        if depth.dtype != np.uint16:
            raise ValueError(f"{entry.depth}: depth: is an 8-bit picture of depth, expected 16-bit depth")
        depths[number] = depth
        if entry.color is not None:
            colors[number] = read_color(entry.color, (color.width, color.height), "color")
        pose = np.eye(4) if entry.camera_to_world is None else entry.camera_to_world
        frames.append(Frame(
            number, None, None, entry.time_s, 0.008, pose, "train", depth_path=entry.depth,
            depth_scale=entry.depth_scale, color_path=entry.color,
        ))  # fmt: skip
        tell((number + 1) / len(recording.frames))
    if all(frame.camera_to_world is None for frame in recording.frames):
        seen = [colors[k][..., 1] if k in colors else depths[k] for k in depths]
        groups = repeat_groups(seen, [k in colors for k in depths])
        frames = [replace(frame, repeat_group=group) for frame, group in zip(frames, groups, strict=True)]
    camera = Camera(width, height, recording.K)
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -baseline_m
    rig = Rig(camera, camera, left_to_right, projector, color=color if colors else None)
    scene = scene or recording.scene
    notes = f"imported from {recording.kind}: colour and depth, no infrared; baseline and pattern are nominal"
    capture = Capture(out, out.name, scene or out / "scene.gltf", rig, tuple(frames), {"notes": notes})
    write_capture(out, capture, {}, pattern, depths, colors, with_empty_scene=scene is None)
    return capture


def nearest(times: Iterable[float], time_s: float, within_s: float) -> float | None:
    """Returns the time in `times` that is nearest to time_s, or None if it is farther than within_s."""
    found = min(times, key=lambda t: abs(t - time_s), default=None)
    return found if found is not None and abs(found - time_s) <= within_s else None
