# SPDX-License-Identifier: Apache-2.0
"""Averages a capture's images over blocks of pixels. The lab searches on such smaller images and reports figures for
the whole ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from activestereo.capture.capture import SIDES, Capture, Rig
from activestereo.capture.capture_json import CaptureError

# Images up to this size stay whole; larger ones are binned to at most half as many pixels.
MOST_PIXELS = 848 * 480


def usual_samples(capture: Capture) -> int:
    """Returns the default samples per pixel: 64 for a whole image of usual size; larger images share the same total."""
    return max(4, round(64 * min(1.0, MOST_PIXELS / _pixels(capture.rig))))


def usual_binning(capture: Capture) -> int:
    """Returns the default side, in pixels, of the square blocks over which a capture's images are averaged."""
    pixels = _pixels(capture.rig)
    return 1 if pixels <= MOST_PIXELS else int(np.ceil(np.sqrt(2.0 * pixels / MOST_PIXELS)))


def _pixels(rig: Rig) -> int:
    return max(camera.width * camera.height for camera in (rig.left, rig.right))


def binned(capture: Capture, size: int) -> Capture:
    """Returns the capture with infrared images averaged over size x size pixels, and K and line time to match. The
    device's depth is dropped, since it was matched on whole images. Raises CaptureError if too few pixels remain."""
    if size == 1:
        return capture
    least = min(min(camera.width, camera.height) for camera in (capture.rig.left, capture.rig.right))
    most = least // 16
    if size > most:
        raise CaptureError(f"{capture.path}: images of {least} pixels cannot be averaged over {size}: give 1 to {most}")
    rig, cameras = capture.rig, {}
    for side in SIDES:
        camera = rig.camera(side)
        K = camera.K.copy()
        K[:2] /= size
        K[:2, 2] += 0.5 / size - 0.5  # pixel centres are whole numbers
        cameras[side] = replace(camera, width=camera.width // size, height=camera.height // size, K=K)
    rig = replace(rig, **cameras, line_time_s=None if rig.line_time_s is None else size * rig.line_time_s)
    frames = tuple(replace(frame, depth_path=None, depth_scale=None) for frame in capture.frames)
    return replace(capture, rig=rig, frames=frames, binning=size, whole=capture)


def unbinned(capture: Capture) -> Capture:
    """Returns the capture from which binned() made this one, with this one's poses, focal lengths and projector. A
    capture that is not binned returns unchanged."""
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
