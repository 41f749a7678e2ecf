# SPDX-License-Identifier: Apache-2.0
"""Reads camera poses, finds frames that repeat one view in recordings without poses, and writes frames as a capture."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from activestereo.capture.capture import SIDES, Capture
from activestereo.capture.images import block_means, image_size, read_color, read_gray
from activestereo.capture.write import write_capture
from activestereo.common.input_files import read_text
from activestereo.common.pose import rigid_motion
from activestereo.common.progress_bar import Progress, silent

INFRARED = ("Infrared 1", "Infrared 2")  # the left and the right camera, as librealsense calls them


def pose_of_seven(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """Returns the 4x4 pose of x, y, z, qx, qy, qz, qw, the numbers in TUM's and robots' files. name: begins the message
    of the ValueError, which is raised if the quaternion's length is more than 1 % off 1."""
    x, y, z, qx, qy, qz, qw = np.asarray(values, dtype=np.float64)
    norm = float(np.linalg.norm((qx, qy, qz, qw)))
    if abs(norm - 1.0) > 0.01:
        raise ValueError(f"{name}: the quaternion's length is {norm:.3f}, expected 1")
    return rigid_motion((x, y, z), Rotation.from_quat((qx, qy, qz, qw)).as_matrix())


def read_trajectory(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reads (times [n] in seconds, increasing; camera_to_world [n, 4, 4]). Raises ValueError with file, line and
    fault."""
    times, poses = list[float](), list[NDArray[np.float64]]()
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise ValueError(f"{path}: line {number}: '{line.strip()}' is not eight numbers") from None
        if len(values) != 8 or not np.isfinite(values).all():
            raise ValueError(
                f"{path}: line {number}: {len(values)} numbers, expected finite timestamp tx ty tz qx qy qz qw"
            )
        poses.append(pose_of_seven(values[1:], f"{path}: line {number}"))
        if times and values[0] <= times[-1]:
            raise ValueError(f"{path}: line {number}: timestamp {values[0]:.6f} is not after {times[-1]:.6f}")
        times.append(values[0])
    if not poses:
        raise ValueError(f"{path}: holds no poses: each line is timestamp tx ty tz qx qy qz qw")
    return np.array(times), np.array(poses)


def pose_at(times: NDArray[np.float64], poses: NDArray[np.float64], time: float, name: str) -> NDArray[np.float64]:
    """Returns the 4x4 pose at a time, interpolated between its neighbours. Raises ValueError, which begins with `name`,
    if the time is more than 50 ms outside of `times`."""
    if not times[0] - 0.05 <= time <= times[-1] + 0.05:
        raise ValueError(f"{name}: its time {time:.6f} s is outside the poses' {times[0]:.6f} to {times[-1]:.6f} s")
    time = float(np.clip(time, times[0], times[-1]))
    if len(times) == 1:
        return poses[0]
    turn = Slerp(times, Rotation.from_matrix(poses[:, :3, :3]))(time).as_matrix()
    return rigid_motion([np.interp(time, times, poses[:, axis, 3]) for axis in range(3)], turn)


_SIDE = 4  # pixels of a block; a dot that moves by a part of a pixel keeps some 0.4 of its variance in block means
# White noise keeps 1/16; noise that rectification has blurred, at most 0.19.
_MOST_SLOW = 0.25
_RECENT = 2  # latest groups of a view that a frame is compared with, since its projector may blink


def repeat_groups(images: Sequence[NDArray], views: Sequence[Hashable]) -> list[int | None]:
    """Returns the number of each image's repeat group, None for an image without a repeat. images: [height, width]
    each, in order of time. views: key of each image's view; only images with equal keys can be repeats."""
    groups: list[list[int]] = []
    recent: dict[Hashable, list[list[int]]] = {}
    for k, (image, view) in enumerate(zip(images, views, strict=True)):
        near = recent.setdefault(view, [])
        group = next((g for g in near if _show_same_view(image, images[g[0]])), None)
        if group is None:
            group = []
            groups.append(group)
        recent[view] = [group, *(g for g in near if g is not group)][:_RECENT]
        group.append(k)
    number = {k: n for n, group in enumerate(g for g in groups if len(g) > 1) for k in group}
    return [number.get(k) for k in range(len(images))]


def _show_same_view(image: NDArray, other: NDArray) -> bool:
    """Returns whether two images show one view: they differ only by noise, brightness and offsets of rows and columns.
    The test averages their difference over blocks, which removes most of the noise and little of a movement."""
    first, second = image.astype(np.float32), other.astype(np.float32)
    scale = float(np.vdot(first, second)) / max(float(np.vdot(second, second)), 1.0)
    difference = first - scale * second
    difference -= difference.mean(axis=1, keepdims=True)
    difference -= difference.mean(axis=0)
    rows, columns = (length // _SIDE * _SIDE for length in difference.shape)
    whole = difference[:rows, :columns]
    return bool(block_means(whole, _SIDE).var() <= _MOST_SLOW * whole.var())


def write_frames(
    capture: Capture, pattern: NDArray[np.uint8], views: Sequence[Hashable] | None = None,
    progress: Progress = silent,
) -> Capture:  # fmt: skip
    """Reads the images that a capture's frames name, writes the capture at its path, which must not exist, and returns
    it. It writes an empty scene if scene_path is the path's scene.gltf. 16-bit infrared images without pixels above 255
    become 8-bit. views: key of each frame's view, for frames of unknown poses; frames of one view whose pictures agree
    become a repeat group. Raises ValueError with the file if sizes differ, depth has 8 bits or a file is damaged."""
    rig, frames = capture.rig, capture.frames
    images, depths, colors = {}, {}, {}
    seen: list[NDArray[np.generic]] = []
    for number, frame in enumerate(frames):
        for side, name in zip(SIDES if frame.has_infrared else (), INFRARED, strict=False):
            images[frame.id, side] = read_gray(frame.path(side), rig.camera(side).size, name)
        if frame.depth_path is not None:
            size = image_size(frame.depth_path, "Depth")
            if frame.has_infrared and size != rig.left.size:
                own, pair = ("x".join(map(str, sides)) for sides in (size, rig.left.size))
                remedy = "record both in one size, without a decimation filter, or move the depth images elsewhere"
                raise ValueError(f"{frame.depth_path}: Depth: is {own}, the infrared images are {pair}: {remedy}")
            depths[frame.id] = read_gray(frame.depth_path, rig.left.size, "Depth")
            if depths[frame.id].dtype != np.uint16:
                raise ValueError(
                    f"{frame.depth_path}: Depth: is an 8-bit picture of depth, expected 16-bit depth: save the raw "
                    "stream"
                )
        if rig.color is not None and frame.color_path is not None:
            colors[frame.id] = read_color(frame.color_path, rig.color.size, "Color")
        if frame.has_infrared:
            seen.append(images[frame.id, "left"])
        else:
            seen.append(colors[frame.id][..., 1] if frame.id in colors else depths[frame.id])
        progress((number + 1) / len(frames))
    if views is not None:
        groups = repeat_groups(seen, views)
        frames = tuple(replace(frame, repeat_group=group) for frame, group in zip(frames, groups, strict=True))
    is_byte = all(image.max() <= 255 for image in images.values())
    if is_byte:
        images = {key: image.astype(np.uint8) for key, image in images.items()}
    capture = replace(capture, rig=replace(rig, bit_depth=8 if is_byte else 16), frames=frames)
    is_empty = capture.scene_path == capture.path / "scene.gltf"
    write_capture(capture.path, capture, images, pattern, depths, colors, with_empty_scene=is_empty)
    return capture
