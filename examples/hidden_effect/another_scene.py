# SPDX-License-Identifier: Apache-2.0
"""The found model drives a sensor in a scene that no fit has seen: do its depth errors become those of the true sensor?

The true sensor's infrared pairs and the simulated ones pass the same stereo matcher; errors are in pixels of disparity,
against the scene's geometry.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import simsense
from activestereo import Pose, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.capture.capture import Capture, Frame, read_capture
from activestereo.camera.plan import matcher_parameters
from activestereo.common.pose import CAMERA_TO_BODY, as_matrix
from activestereo.model import Quantity, SensorModel

INK = "#1f2933"
# Errors beyond it are mismatches, which no model of a sensor explains.
_LARGEST_PX = 3.0
_SHOWN_PX = 1.0


@dataclass(frozen=True)
class Errors:
    """Errors of disparity [frame][height][width] in pixels, NaN where nothing was measured."""

    pixels: NDArray[np.float32]

    @property
    def filled(self) -> float:
        return float(np.isfinite(self.pixels).mean())

    def away_from(self, other: Errors) -> float:
        """Root mean square difference where both have measured."""
        both = np.abs(self.pixels - other.pixels)
        return float(np.sqrt(np.nanmean(np.where(both < _LARGEST_PX, both, np.nan) ** 2)))


def without_effects(found: SensorModel, nuisances: Mapping[str, float]) -> SensorModel:
    """The model as it was before: the same rig, pattern and noise, and the light's scales that fit best then."""
    scales = {name: Quantity(nuisances[name]) for name in ("projector_scale", "ambient_scale", "black_dn")}
    return replace(found, effects=(), nuisances=scales)


def true_and_simulated(folder: Path, models: list[SensorModel]) -> tuple[Errors, list[Errors]]:
    """Depth of the sensor that took the capture in `folder`, and of each model in its place. The models' albedos are
    another scene's and are left out."""
    capture = read_capture(folder)
    exposure = capture.frames[0].exposure_gain  # a sensor has one
    frames = [f for f in capture.frames if f.exposure_gain == exposure and f.projector_power == 1.0]
    expected = None
    simulated = []
    for model in models:
        expected, measured = _simulated(capture, frames, replace(model, materials={}))
        simulated.append(_errors(measured, expected))
    config = _config(capture, models[0])
    camera = simsense.Camera(*config.ir_resolution, config.ir_intrinsic)
    engine = simsense.Engine(
        simsense.Device("host"), camera, camera, capture.rig.left_to_right, rectified=True, **matcher_parameters(config)
    )
    pairs = [(capture.ir(frame, "left"), capture.ir(frame, "right")) for frame in frames]
    measured = np.stack([engine.compute(left, right, ("disparity",))["disparity"] for left, right in pairs])
    return _errors(measured, expected), simulated


def picture(true: Errors, before: Errors, after: Errors, frame: int = -1) -> Figure:
    """One frame's errors of the three, side by side."""
    figure = Figure(figsize=(12, 3.3), layout="constrained", facecolor="white")
    titles = (
        "the true sensor's depth errors",
        f"simulated without effects: {before.away_from(true):.2f} px away",
        f"simulated with what was found: {after.away_from(true):.2f} px away",
    )
    for axes, errors, title in zip(figure.subplots(1, 3), (true, before, after), titles, strict=True):
        shown = axes.imshow(errors.pixels[frame], cmap="RdBu_r", vmin=-_SHOWN_PX, vmax=_SHOWN_PX)
        axes.set_facecolor(INK)
        axes.set_title(title, loc="left", fontsize=11, color=INK)
        axes.set(xticks=[], yticks=[])
    figure.colorbar(shown, ax=figure.axes, label="error of disparity, px", shrink=0.8)
    return figure


def _config(capture: Capture, model: SensorModel) -> StereoDepthSensorConfig:
    config = StereoDepthSensorConfig.from_model(model)
    config.max_disparity = capture.depth_engine["max_disparity"]
    return config


def _simulated(
    capture: Capture, frames: list[Frame], model: SensorModel
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The scene's disparity and the measured one [frame][height][width]."""
    config = _config(capture, model)
    left_of_sensor = as_matrix(config.trans_pose_l) @ CAMERA_TO_BODY
    expected, measured = [], []
    with closing(StereoDepthSensor(config, str(capture.scene_path), model=model)) as sensor:
        for frame in frames:
            sensor.set_local_pose(Pose(frame.camera_to_world @ np.linalg.inv(left_of_sensor)))
            sensor.set_conditions(frame.temperature_c, frame.timestamp_s)
            sensor.take_picture(infrared_only=True)
            sensor.compute_depth()
            measured.append(sensor.get_disparity())
            depth_m = sensor.get_picture("depth", camera="left")[..., 0]
            expected.append(config.focal_baseline_px_m / np.where(depth_m > 0, depth_m, np.inf))
    return np.stack(expected), np.stack(measured)


def _errors(measured: NDArray[np.float32], expected: NDArray[np.float32]) -> Errors:
    error = np.where(measured > 0, measured - expected, np.nan)
    return Errors(np.where(np.abs(error) < _LARGEST_PX, error, np.nan))
