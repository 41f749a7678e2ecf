# SPDX-License-Identifier: Apache-2.0
"""Captures with images averaged over blocks of pixels. The lab searches large images so, and reports figures on the
whole ones."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from activestereo.capture.capture import SIDES, Camera, Capture
from activestereo.capture.capture_json import CaptureError

# Images up to this size stay whole; larger ones are binned to at most half as many pixels.
MOST_PIXELS = 848 * 480

_Camera = TypeVar("_Camera", bound=Camera)


def usual_samples(capture: Capture) -> int:
    """Default samples per pixel: 64 for a whole image of usual size; larger images share the same total."""
    return max(4, round(64 * min(1.0, MOST_PIXELS / _pixels(capture))))


def usual_binning(capture: Capture) -> int:
    """Default side of the block, along rows and columns, over which a capture's images are averaged."""
    pixels = _pixels(capture)
    return 1 if pixels <= MOST_PIXELS else int(np.ceil(np.sqrt(2.0 * pixels / MOST_PIXELS)))


def _pixels(capture: Capture) -> int:
    return max(capture.rig.camera(side).width * capture.rig.camera(side).height for side in SIDES)


def binned(capture: Capture, size: int) -> Capture:
    """The capture with its infrared images averaged over size x size pixels, without the device's depth, which was
    matched on the whole images. Raises CaptureError if no pixel of an image is left."""
    if size == 1:
        return capture
    least = min(min(capture.rig.camera(side).width, capture.rig.camera(side).height) for side in SIDES)
    most = least // 16
    if size > most:
        raise CaptureError(f"{capture.path}: images of {least} pixels cannot be averaged over {size}: give 1 to {most}")
    rig, rows = capture.rig, capture.rig.line_time_s
    rig = replace(
        rig, left=_camera(rig.left, size), right=_camera(rig.right, size),
        line_time_s=None if rows is None else size * rows,
    )  # fmt: skip
    frames = tuple(replace(frame, depth_path=None, depth_scale=None) for frame in capture.frames)
    return replace(capture, rig=rig, frames=frames, binning=size, whole=capture)


def unbinned(capture: Capture) -> Capture:
    """The whole capture with a binned one's poses, focal lengths and projector; any other capture unchanged."""
    if capture.whole is None:
        return capture
    whole, rig = capture.whole, capture.rig
    stated = binned(whole, capture.binning).rig
    cameras = {}
    for side in SIDES:
        K = whole.rig.camera(side).K.copy()
        K[:2, :2] *= rig.camera(side).K[0, 0] / stated.camera(side).K[0, 0]
        cameras[side] = replace(whole.rig.camera(side), K=K)
    rig = replace(whole.rig, **cameras, left_to_right=rig.left_to_right, projector=rig.projector)
    pose_of = {frame.id: frame.camera_to_world for frame in capture.frames}
    frames = tuple(replace(frame, camera_to_world=pose_of[frame.id]) for frame in whole.frames)
    return replace(whole, rig=rig, frames=frames)


def _camera(camera: _Camera, size: int) -> _Camera:
    K = camera.K.copy()
    K[:2] /= size
    K[:2, 2] += 0.5 / size - 0.5  # pixel centres are whole numbers
    return replace(camera, width=camera.width // size, height=camera.height // size, K=K)
