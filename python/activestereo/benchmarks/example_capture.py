# SPDX-License-Identifier: Apache-2.0
"""Writes a small capture of the example scene in matt colours, rendered instead of recorded. Its camera is a D435 with
a quarter of its resolution, and shot and read noise. On request it has an effect for `diagnose` to find."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from activestereo.camera.plan import pattern_of
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import Camera, Capture, Frame, Projector, Rig, read_capture
from activestereo.capture.images import read_gray, write_gray
from activestereo.capture.write import write_capture
from activestereo.common.pose import look_at, rigid_motion
from activestereo.common.progress_bar import Progress
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.effects.core.model import Model
from activestereo.effects.engines import CaptureRenderer
from activestereo.scene_io.example_scene import write_table_top

_SCALE = 0.25
_BASELINE_M, _PROJECTOR_M = 0.05, 0.029
_EXPOSURE_S, _BLACK_DN = 0.004, 5.0
_PROJECTOR_DN_PER_S, _ROOM_DN_PER_S = 120000.0, 9000.0  # from a projector of 1 W/sr, and from a radiance of 1
_NOISE_FLOOR_DN2, _NOISE_SLOPE_DN = 0.3, 0.02  # variance = floor + slope x light, DN
_BOUNCES = 8  # the default of diagnose and compare
_REPEATS = 2  # frames of the first view, from which the noise is measured
_PLACES_M = ((-0.02, 0.46, 0.72), (0.25, 0.40, 0.62), (-0.30, 0.35, 0.60), (0.10, 0.55, 0.55))
_TARGET_M, _UP = (0.0, 0.035, -0.02), (0.0, 1.0, 0.0)
_HELD_OUT = 1  # number of views in the test split, taken from the end
# {effect that can be hidden: (the lab's name of its parameter, the value)}.
HIDDEN = {"radial_distortion": ("k1", 0.01), "vignetting": ("exponent", 3.0), "gain_mismatch": ("gain", 0.18)}


def write_example_capture(
    folder: str | Path, device: str | int = "auto", seed: int = 0, progress: Progress | None = None,
    samples_per_pixel: int = 64, hidden: str | None = None,
) -> Capture:  # fmt: skip
    """Writes the capture as the new folder and returns it. progress: called with the fraction done. hidden: an effect
    of HIDDEN to put into the images, by formulas that differ from those of the lab; None for no effect."""
    with TemporaryDirectory() as place:
        capture = _without_images(Path(place))
        renderer = CaptureRenderer(device, samples_per_pixel, _BOUNCES, seed, smooth=False)
        random = np.random.Generator(np.random.PCG64([seed, 37]))
        images = {}
        for key, light in renderer.lights(capture, Model(), progress=progress).items():
            dn = _EXPOSURE_S * (_PROJECTOR_DN_PER_S * light.projector + _ROOM_DN_PER_S * light.ambient)
            image = _through_lens(dn.astype(np.float64), capture.rig.left.K, hidden)
            variance = _NOISE_FLOOR_DN2 + _NOISE_SLOPE_DN * np.maximum(image, 0.0) - ROUNDING_VARIANCE
            image += np.sqrt(variance) * random.standard_normal(image.shape)
            if hidden == "gain_mismatch":  # of an amplifier, which acts after the noise
                image *= 1.0 + (0.5 if key[1] == "right" else -0.5) * HIDDEN[hidden][1]
            images[key] = np.clip(np.rint(image + _BLACK_DN), 0, 255).astype(np.uint8)
        write_capture(Path(folder), capture, images, read_gray(capture.rig.projector.pattern_path))
    return read_capture(folder)


def _through_lens(image: NDArray[np.float64], K: NDArray[np.float64], hidden: str | None) -> NDArray[np.float64]:
    """Returns the image, [height, width], with the hidden vignetting or distortion; unchanged for others. K: 3x3."""
    v, u = np.indices(image.shape, dtype=np.float64)
    x, y = (u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]
    r2 = x * x + y * y
    if hidden == "vignetting":
        return image * (1.0 + r2) ** (-0.5 * HIDDEN[hidden][1])  # a power of the angle's cosine
    if hidden != "radial_distortion":
        return image
    scale = np.ones_like(r2)
    for _ in range(12):  # the ray that r (1 + k1 r^2) draws in each pixel, by fixed-point iteration
        scale = 1.0 / (1.0 + HIDDEN[hidden][1] * r2 * scale**2)
    places = [K[1, 1] * y * scale + K[1, 2], K[0, 0] * x * scale + K[0, 2]]
    return np.asarray(map_coordinates(image, places, order=5, mode="nearest"))


def _without_images(place: Path) -> Capture:
    scene, pattern_path = place / "table_top.gltf", place / "pattern.png"
    write_table_top(scene, is_matt=True)
    config = StereoDepthSensorConfig("D435").scaled(_SCALE)
    drawn = pattern_of(config)
    assert drawn is not None, "a D435 has a pattern"
    pattern, pattern_K = drawn
    write_gray(pattern_path, pattern)
    width, height = config.ir_resolution
    camera = Camera(width, height, np.asarray(config.ir_intrinsic, np.float64))
    left_to_right, left_to_projector = (rigid_motion((-aside, 0.0, 0.0)) for aside in (_BASELINE_M, _PROJECTOR_M))
    rig = Rig(camera, camera, left_to_right, Projector(pattern_path, np.asarray(pattern_K), left_to_projector))
    views = [0] * (_REPEATS - 1) + list(range(len(_PLACES_M)))
    frames = tuple(
        Frame(
            id=number,
            left_path=None,
            right_path=None,
            timestamp_s=0.1 * number,
            exposure_s=_EXPOSURE_S,
            camera_to_world=look_at(_PLACES_M[view], _TARGET_M, _UP),
            split="test" if view >= len(_PLACES_M) - _HELD_OUT else "train",
            repeat_group=0 if view == 0 else None,
        )
        for number, view in enumerate(views)
    )
    return Capture(place, "table_top", scene, rig, frames)
