# SPDX-License-Identifier: Apache-2.0
"""Provides the page's frames. A CaptureSource has a capture's measured frames, and simulates them in the capture's
scene. A SceneSource simulates a sensor at the cameras of a scene file, and has no measurement."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import SIDES, Capture, Frame
from activestereo.common.computed_once import computed_once
from activestereo.common.input_files import read_json_object
from activestereo.common.lens import disparity_of
from activestereo.common.pose import CAMERA_TO_BODY, Pose, as_matrix
from activestereo.compare.cache import LayerCache
from activestereo.compare.depth_compare import DepthModel
from activestereo.compare.noise import fit_noise_model, repeat_statistics
from activestereo.compare.nuisances import fit_nuisances
from activestereo.compare.render import render_frames
from activestereo.effects.core.surfaces import split_surfaces, split_surfaces_named
from activestereo.effects.engines import CaptureRenderer
from activestereo.model import Imager, Pattern, Quantity, Rig, SensorModel
from activestereo.model.configure import exposed
from activestereo.model.diagnosed import calibrated
from activestereo.model.model import NUISANCES
from activestereo.report.view.simulation import Exposure, Pictures, Simulation, drawn_from_left
from activestereo.scene_io.defaults import light_closed_room, overall_view
from activestereo.scene_io.scene_files import load_scene_file
from activestereo.scene_io.staging import room_radiance

# The laser's slider ends at this multiple of the capture's power.
_STRONGEST_LASER = 3.0
_SOURCE = "fitted in activestereo view"
# The number of poses to which the light is fitted; a single pose suffices if its dots are bright.
_MOST_POSES = 3
_SAMPLES, _BOUNCES = 16, 4


class CaptureSource:
    """Provides a capture's measured and simulated frames. model: known figures of the sensor; light and noise that it
    lacks are fitted.

    A capture with an empty scene is not simulated.
    """

    def __init__(self, capture: Capture, device: kuafu.Device, model: SensorModel | None = None) -> None:
        self.title = capture.name
        self._given = SensorModel() if model is None else model
        self._capture = calibrated(capture, self._given)
        self._focal_baseline_px_m = float(self._capture.rig.left.K[0, 0]) * self._capture.rig.baseline_m
        self._device = device
        self._exposures: dict[int, Exposure] = {}
        self._matching = threading.Lock()  # the engine takes one call at a time
        self._frames = {frame.id: frame for frame in capture.frames if frame.has_infrared}
        if not self._frames:
            raise ValueError(f"{capture.path}: has no infrared images, only colour and depth: there is nothing to show")

    def frames(self) -> list[dict[str, object]]:
        """Returns [{id, label}] of the frames in the capture's order."""
        return [
            {"id": f.id, "label": f"{f.id}, {f.split}{', projector off' if f.projector_power == 0 else ''}"}
            for f in self._frames.values()
        ]

    def facts(self) -> dict[str, object]:
        """Returns the left camera's figures (size, K, focal_baseline_px_m), with which the page computes depth and
        points."""
        left = self._capture.rig.left
        return _facts(left.size, left.K, self._focal_baseline_px_m, has_measured=True)

    def measured(self, frame_id: int) -> Pictures:
        """Returns one measured frame with the device's depth, or with depth matched from the pair if the device gave
        none."""
        frame, capture = self._frame(frame_id), self._capture
        left, right = (capture.ir(frame, side) for side in ("left", "right"))
        depth = capture.depth(frame)
        if depth is None:
            with self._matching:
                depth = self._matcher().depth(left, right)
        return Pictures(left, right, disparity_of(depth, self._focal_baseline_px_m), frame.exposure_s, frame.gain)

    @computed_once
    def simulation(self) -> Simulation | None:
        """Loads the capture's scene into a Simulation; None if the scene is empty."""
        path = self._capture.scene_path
        if not path.is_file():
            return None
        if path.suffix.lower() == ".gltf" and not read_json_object(path).get("meshes"):  # as `import` writes it
            return None
        scene = kuafu.Scene(self._device)
        load_scene_file(scene, path)
        split_surfaces(scene, path)
        return Simulation(scene)

    def exposure(self, frame_id: int) -> Exposure:
        """Returns the Exposure that simulates one frame: the sensor's settings, model and pose."""
        if frame_id not in self._exposures:
            frame = self._frame(frame_id)
            config = self._config(frame)
            conditions = config.ir_ambient_radiance, frame.temperature_c, frame.timestamp_s, frame.camera_velocity
            self._exposures[frame_id] = Exposure(config, self._model(), frame.camera_to_world, *conditions)
        return self._exposures[frame_id]

    def _frame(self, frame_id: int) -> Frame:
        if frame_id not in self._frames:
            raise ValueError(f"{self.title} has no frame {frame_id!r} with infrared images")
        return self._frames[frame_id]

    @computed_once
    def _matcher(self) -> DepthModel:
        return DepthModel(self._capture)

    def _config(self, frame: Frame) -> StereoDepthSensorConfig:
        """Returns the sensor's configuration in a frame, with the left camera in the colour camera's place."""
        model, config = self._model(), StereoDepthSensorConfig()
        config.trans_pose_l = Pose()
        low, _, step = config.laser_power_limits_mw
        config.laser_power_limits_mw = (low, _STRONGEST_LASER * config.laser_power_nominal_mw, step)
        for name, value in exposed(vars(config), model, frame).items():
            setattr(config, name, value)
        for name, value in self._matcher().parameters.items():
            setattr(config, name, value)
        return drawn_from_left(config)

    @computed_once
    def _model(self) -> SensorModel:
        """Returns the sensor's model: the given figures, completed by the capture's rig and pattern and by fitted light
        and noise."""
        capture, given = self._capture, self._given
        rig, projector = capture.rig, capture.rig.projector
        pattern = given.pattern or Pattern(projector.K, projector.pattern_path)
        model = replace(given, rig=Rig.of_capture(rig), pattern=pattern)
        if not {"projector_scale", "ambient_scale", "black_dn"} <= set(given.nuisances):
            fitted = _fitted_nuisances(capture, CaptureRenderer(self._device))
            model = replace(model, nuisances=fitted | dict(given.nuisances))
        if model.imager is None:
            noise = fit_noise_model(repeat_statistics(capture), model.nuisances["black_dn"].value, rig.max_dn)
            model = replace(model, imager=noise and Imager.of_values(vars(noise), _SOURCE))
        return model


def _fitted_nuisances(capture: Capture, renderer: CaptureRenderer) -> dict[str, Quantity]:
    """Fits projector scale, ambient scale and black level to a few frames by least squares, under a model without
    effects. Returns {name: Quantity}. Raises ValueError if there is nothing to fit."""
    poses: dict[bytes, Frame] = {}
    for frame in [*capture.split("train"), *capture.frames]:
        if frame.has_infrared:
            poses.setdefault(frame.camera_to_world.tobytes(), frame)
    frames = list(poses.values())[:_MOST_POSES]
    layers = render_frames(capture, renderer, _SAMPLES, _BOUNCES, cache=LayerCache(), frames=frames)
    seen = [(f, layers[f.id][side], capture.ir(f, side)) for f in frames for side in SIDES]
    values = vars(fit_nuisances(seen, capture.rig.max_dn, capture.rig.black_dn).nuisances)
    return {name: Quantity(float(value), unit=NUISANCES[name][0], source=_SOURCE) for name, value in values.items()}


class SceneSource:
    """Simulates frames of a scene file. config: the sensor. model: the sensor's effects, None for none."""

    def __init__(
        self, path: Path, device: kuafu.Device, config: StereoDepthSensorConfig, model: SensorModel | None
    ) -> None:
        self.title, self._path, self._device = path.name, path, device
        self._config, self._model = config, SensorModel() if model is None else model
        self._left_config = drawn_from_left(config)

    def frames(self) -> list[dict[str, object]]:
        """Returns [{id, label}] of the scene's cameras, or of one chosen view if it has none."""
        count = self._scene().summary.camera_count
        return [{"id": n, "label": f"camera {n}" if count else "chosen view"} for n in range(max(count, 1))]

    def facts(self) -> dict[str, object]:
        """Returns the left camera's figures, with the keys of CaptureSource.facts()."""
        own = self._left_config
        return _facts(own.ir_resolution, own.ir_intrinsic, own.focal_baseline_px_m, has_measured=False)

    def measured(self, frame_id: int) -> Pictures:
        raise ValueError(f"{self.title} is a scene: nothing was measured in it")

    @computed_once
    def simulation(self) -> Simulation:
        return Simulation(self._scene())

    def exposure(self, frame_id: int) -> Exposure:
        """Returns the Exposure of the sensor with its colour camera at the scene's camera number frame_id."""
        scene = self._scene()
        known = [frame["id"] for frame in self.frames()]
        if frame_id not in known:
            raise ValueError(f"{self.title} has no camera {frame_id!r}, only {known[0]} to {known[-1]}")
        colour = scene.camera(frame_id).camera_to_world if scene.summary.camera_count else self._chosen()
        colour_to_left = CAMERA_TO_BODY.T @ as_matrix(self._config.trans_pose_l) @ CAMERA_TO_BODY
        return Exposure(self._left_config, self._model, np.asarray(colour) @ colour_to_left)

    @computed_once
    def _chosen(self) -> NDArray[np.float64]:
        return overall_view(self._scene())[0]

    @computed_once
    def _scene(self) -> kuafu.Scene:
        scene = kuafu.Scene(self._device)
        dome = load_scene_file(scene, self._path)
        if not scene.summary.triangle_count:
            raise ValueError(f"{self._path}: there is nothing to see in it: no triangles")
        split_surfaces_named(scene, self._path, self._model.surfaces)
        if dome is None:
            light_closed_room(scene)
        room = room_radiance(scene)
        scene.set_environment(dome or (room, room, room))
        return scene


def _facts(size: tuple[int, int], K: Any, focal_baseline_px_m: float, has_measured: bool) -> dict[str, object]:
    named = {"has_measured": has_measured, "width": size[0], "height": size[1]}
    return named | {"k": np.ravel(K).tolist(), "focal_baseline_px_m": focal_baseline_px_m}
