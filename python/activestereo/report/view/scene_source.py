# SPDX-License-Identifier: Apache-2.0
"""Serves a scene file to the page: a preset's sensor at the scene's cameras. Without a measurement, the page compares
with the first picture, before any slider moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.computed_once import computed_once
from activestereo.common.pose import CAMERA_TO_BODY, as_matrix
from activestereo.model import SensorModel
from activestereo.report.view.simulation import Exposure, Pictures, Simulation, drawn_from_left
from activestereo.scene_io.defaults import light_closed_room, overall_view
from activestereo.scene_io.scene_files import load_scene_file
from activestereo.scene_io.staging import room_radiance


class SceneSource:
    """Simulates the viewer's pictures of a scene file. config: the sensor; model: the sensor's effects, None for
    none."""

    def __init__(
        self, path: Path, device: kuafu.Device, config: StereoDepthSensorConfig, model: SensorModel | None = None
    ) -> None:
        self.title, self._path, self._device = path.name, path, device
        self._config, self._model = config, SensorModel() if model is None else model
        self._left_config = drawn_from_left(config)

    def frames(self) -> list[dict[str, object]]:
        """Returns [{id, label}] of the scene's cameras, or of one chosen view if it has none."""
        count = self._scene().summary.camera_count
        return [{"id": n, "label": f"camera {n}" if count else "chosen view"} for n in range(max(count, 1))]

    def facts(self) -> dict[str, object]:
        """Returns the left camera's figures (size, max_dn, K, focal_baseline_px_m), with which the page computes
        depth and points."""
        (width, height), signal = self._left_config.ir_resolution, self._config.ir_signal
        bits = int(signal.get("bit_depth", 8)) if isinstance(signal, dict) else 8
        return {
            "kind": "scene", "has_measured": False, "width": width, "height": height, "max_dn": 2**bits - 1,
            "k": np.ravel(self._left_config.ir_intrinsic).tolist(), "has_depth": True,
            "focal_baseline_px_m": self._left_config.focal_baseline_px_m,
        }  # fmt: skip

    def measured(self, frame_id: int) -> Pictures:
        raise ValueError(f"{self.title} is a scene: nothing was measured in it")

    @computed_once
    def simulation(self) -> Simulation:
        return Simulation(self._scene())

    def exposure(self, frame_id: int) -> Exposure:
        """Returns the Exposure of the sensor whose colour camera stands at one of the scene's cameras."""
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
        if dome is None:
            light_closed_room(scene)
        room = room_radiance(scene)
        scene.set_environment(dome or (room, room, room))
        return scene
