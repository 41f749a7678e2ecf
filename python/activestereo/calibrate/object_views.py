# SPDX-License-Identifier: Apache-2.0
"""A capture's views of an object without the projector's dots: colour images and infrared images with the projector
off, one of each pose, undistorted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Camera, Capture, Frame

MOST_POSES = 12


@dataclass(frozen=True)
class View:
    """image: float32 [height][width][channel], 0..1 of full scale; name: of the image in messages."""

    name: str
    image: NDArray[np.float32]
    K: NDArray[np.float64]
    camera_to_world: NDArray[np.float64]
    frame: Frame

    @property
    def size(self) -> tuple[int, int]:
        """(width, height)."""
        return self.image.shape[1], self.image.shape[0]


def object_views(capture: Capture, most_poses: int = MOST_POSES) -> list[View]:
    """Views of at most so many poses, spread evenly over the capture. ValueError where nothing is free of dots."""
    groups = _poses(capture.frames)
    chosen = [groups[k] for k in np.unique(np.linspace(0, len(groups) - 1, most_poses).round().astype(int))]
    views = [view for frames in chosen for view in _views(capture, frames)]
    if not views:
        raise ValueError(
            f"{capture.path}: no colour image and no infrared image with the projector off: record one of them at each "
            "pose, for dots hide the edges"
        )
    return views


def _poses(frames: Iterable[Frame]) -> list[list[Frame]]:
    """Frames by the camera's pose, in order."""
    out: dict[bytes, list[Frame]] = {}
    for frame in frames:
        if not np.isfinite(frame.camera_to_world).all():
            raise ValueError(f"frames[id={frame.id}].camera_to_world: is not finite")
        out.setdefault(np.round(frame.camera_to_world, 7).tobytes(), []).append(frame)
    return list(out.values())


def _views(capture: Capture, frames: list[Frame]) -> list[View]:
    """Repeats are averaged."""
    out = []
    rig, pose = capture.rig, frames[0].camera_to_world
    with_color = [frame for frame in frames if frame.color_path is not None]
    if with_color and rig.color is not None:
        images = [np.asarray(capture.color(frame), np.float32) / 255.0 for frame in with_color]
        to_world = np.asarray(pose @ np.linalg.inv(rig.color.left_to_color), np.float64)
        name = f"frames[id={with_color[0].id}].color"
        out.append(View(name, _pinhole(np.mean(images, axis=0), rig.color), rig.color.K, to_world, with_color[0]))
    dark = [frame for frame in frames if frame.projector_power == 0 and frame.has_infrared]
    for side in SIDES if dark else ():
        camera = rig.camera(side)
        image = np.mean([capture.ir(frame, side) for frame in dark], axis=0) / rig.max_dn
        left_to_side = np.eye(4) if side == "left" else rig.left_to_right
        to_world = np.asarray(pose @ np.linalg.inv(left_to_side), np.float64)
        out.append(
            View(f"frames[id={dark[0].id}].{side}", _pinhole(image[..., None], camera), camera.K, to_world, dark[0])
        )
    return out


def _pinhole(image: NDArray[np.floating], camera: Camera) -> NDArray[np.float32]:
    image = np.asarray(image, np.float32)
    if not camera.is_pinhole:
        if len(camera.distortion) == 4:
            plain = cv2.fisheye.undistortImage(image, camera.K, camera.distortion, Knew=camera.K)
        else:
            plain = cv2.undistort(image, camera.K, camera.distortion)
        image = plain.reshape(image.shape)
    return image
