# SPDX-License-Identifier: Apache-2.0
"""Replaces a capture's nominal calibration and pattern with a model's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Capture, Projector
from activestereo.capture.images import read_gray
from activestereo.model.model import Pattern, SensorModel

_REACH_SIGMAS = 4.0


@dataclass(frozen=True)
class MeasuredProjector(Projector):
    """A projector whose pattern is an array: relative radiant intensity, float32 [height][width], 0..1."""

    image: NDArray[np.float32] | None = None

    def pattern(self) -> NDArray[np.float32]:
        assert self.image is not None
        return self.image


def calibrated(capture: Capture, model: SensorModel) -> Capture:
    """The capture with those of K, lenses, baseline, projector, pattern and poses that the model has.

    Raises ValueError if the model is of another image size.
    """
    rig = capture.rig
    if model.rig is not None:
        for name, camera, side in (("left", rig.left, model.rig.left), ("right", rig.right, model.rig.right)):
            if (camera.width, camera.height) != (side.width, side.height):
                raise ValueError(
                    f"the model's {name} camera is {side.width}x{side.height}, {capture.path} has "
                    f"{camera.width}x{camera.height}: calibrate the rig at the size that is recorded"
                )
        own = model.rig
        rig = replace(rig, left=own.left, right=own.right, left_to_right=own.left_to_right)
        if model.rig.left_to_projector is not None:
            rig = replace(rig, projector=replace(rig.projector, left_to_projector=model.rig.left_to_projector))
    if model.pattern is not None:
        old, image = rig.projector, pattern_image(model.pattern)
        measured = MeasuredProjector(old.pattern_path, model.pattern.K, old.left_to_projector, image)
        rig = replace(rig, projector=measured)
    measured_of = {pose.stated.tobytes(): pose.measured for pose in model.poses}
    poses = (measured_of.get(f.camera_to_world.tobytes(), f.camera_to_world) for f in capture.frames)
    frames = tuple(replace(f, camera_to_world=pose) for f, pose in zip(capture.frames, poses, strict=True))
    return replace(capture, rig=rig, frames=frames)


def pattern_image(pattern: Pattern) -> NDArray[np.float32]:
    """Relative radiant intensity, [height][width], 1 at the brightest: the file's, or the dots' Gaussians, each with
    its power as its integral, and the common background."""
    if pattern.dots is None:
        assert pattern.file is not None
        return read_gray(pattern.file, key="pattern.file").astype(np.float32) / 255.0
    assert pattern.size is not None and pattern.dot_sigma_px is not None
    (width, height), sigma = pattern.size, pattern.dot_sigma_px
    reach = int(np.ceil(_REACH_SIGMAS * sigma))
    u, v, power = pattern.dots.T
    offsets = np.arange(-reach, reach + 1)
    columns, rows = (np.rint(x).astype(int)[:, None] + offsets for x in (u, v))
    across, down = (np.exp(-0.5 * ((p - x[:, None]) / sigma) ** 2) for p, x in ((columns, u), (rows, v)))
    peak = power / (2.0 * np.pi * sigma**2)
    image = np.zeros((height + 2 * reach, width + 2 * reach))
    centre_u, centre_v = columns[:, reach], rows[:, reach]
    inside = (centre_u >= 0) & (centre_u < width) & (centre_v >= 0) & (centre_v < height)
    places = rows[inside][:, :, None] + reach, columns[inside][:, None, :] + reach
    np.add.at(image, places, (peak[:, None, None] * down[:, :, None] * across[:, None, :])[inside])
    image = image[reach:-reach, reach:-reach] + pattern.background
    return (image / max(float(image.max()), 1e-12)).astype(np.float32)
