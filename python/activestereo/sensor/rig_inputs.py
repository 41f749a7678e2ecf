# SPDX-License-Identifier: Apache-2.0
"""Like sensors as both engines are told of them: inputs by configuration, model, velocity and conditions, and the
cameras and lights that follow from them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.auto_exposure import Setting
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.lens import lens_fields
from activestereo.common.pose import Pose, camera_to_world
from activestereo.effects.core.descriptor import Effect
from activestereo.effects.core.engine import EngineInputs, apply_engine, moved_pose
from activestereo.effects.engines.world import copy_camera
from activestereo.model import SensorModel
from activestereo.sensor.inputs import exposed_anew, fitted_to, give_velocity, sensor_inputs, shutter, twist_of
from activestereo.sensor.rig import LATER, Rig


class RigInputs:
    """config: a copy is kept, which automatic exposure changes. environments, model, source: as SensorEngine has them.
    takes_image_effects: whether effects may act outside of the engines. ValueError for a model that does not fit."""

    def __init__(
        self, config: StereoDepthSensorConfig, scene: kuafu.Scene, environments: Sequence[int | None],
        model: SensorModel | str | PathLike[str] | None, source: object, takes_image_effects: bool,
    ) -> None:  # fmt: skip
        self.config = deepcopy(config)
        self.config.check()
        self.scene, self.is_one = scene, list(environments) == [None]
        # What each sensor's cameras look into.
        self.environments = [environment or 0 for environment in environments]
        self._takes_image_effects = takes_image_effects
        self._effects, self._scene_measurement, self._ambient_radiance = fitted_to(scene, source, model, self.config)
        pattern = self.config.pattern() if self.config.light_dots is None else None
        self.in_scene = Rig(scene, environments, None if pattern is None else pattern[0])
        # The effects that act outside of the engines.
        self.left_over: tuple[tuple[Effect, dict[str, float]], ...] = ()
        self.twist = np.zeros(6)
        self._conditions: tuple[float | None, float] = (None, 0.0)
        self.right_turn: NDArray[np.float64] | None = None  # [sensors, 4, 4]: how the right cameras are turned
        self._frame = 0
        self._rigs: NDArray[np.float64] | None = None
        self._inputs: EngineInputs | None = None
        self._is_closed = False

    def inputs(self) -> EngineInputs:
        """The engines' inputs, with the RGB camera at the origin; found again where sensor or conditions have
        changed."""
        if self._inputs is None:
            c, emitter = self.config, self.config.emitter_power(self._frame)
            inputs = sensor_inputs(
                c, self.scene, self.twist, *self._conditions, self.in_scene.pattern, self._ambient_radiance, emitter
            )
            inputs.scene_materials = self.in_scene.material
            self._scene_measurement.apply(inputs)
            self.left_over = apply_engine(inputs, self._effects.effects)
            self._refuse(inputs)
            cameras = [(side.camera, side.delay_s) for side in inputs.sides]
            self._cameras_on_rig = [
                moved_pose(e.camera_to_world, e.linear_velocity, e.angular_velocity, t) for e, t in cameras
            ]
            if not self._is_closed:
                self.in_scene.enter(inputs, c.projector_intensity * emitter)
                if c.projector_always_on and self._rigs is not None:
                    self.in_scene.shine(self._rigs)
            others = self.environments[1:]
            self._ir_cameras = [[camera, *(copy_camera(camera, 0.0) for _ in others)] for camera, _ in cameras]
            self._rgb_cameras = [self._rgb_camera() for _ in self.environments]
            self._inputs = inputs
        return self._inputs

    def signals(self) -> list[dict[str, float]]:
        """The imagers' parameters, left and right."""
        return [side.signal for side in self.inputs().sides]

    def ir_cameras(self, rigs: NDArray[np.float64]) -> list[kuafu.Camera]:
        """All left ones, then all right ones, as they are: under a model not what the calibration says. rigs: the RGB
        cameras' poses, [sensors, 4, 4], body axes."""
        self.inputs()
        left, right = (rigs @ side for side in self._cameras_on_rig)
        views = np.concatenate([left, right if self.right_turn is None else right @ self.right_turn])
        cameras = [*self._ir_cameras[0], *self._ir_cameras[1]]
        for camera, view in zip(cameras, views, strict=True):
            camera.camera_to_world = view
        return cameras

    def rgb_cameras(self, rigs: NDArray[np.float64]) -> list[kuafu.Camera]:
        self.inputs()
        views = camera_to_world(rigs[0])[None] if self.is_one else rigs @ camera_to_world(Pose())
        for camera, view in zip(self._rgb_cameras, views, strict=True):
            camera.camera_to_world = view
        return self._rgb_cameras

    def visible(self) -> dict[str, Any]:
        """Keyword arguments of a render of the RGB cameras."""
        return {"band": "visible", "environments": self.environments, "optics": self.config.rgb_optics}

    def infrared(self, side: int | None = None) -> dict[str, Any]:
        """Keyword arguments of a render of the infrared cameras. side: 0 or 1, one sensor's; None: all."""
        sides = self.inputs().sides if side is None else [self.inputs().sides[side]]
        seen = [LATER if one.delay_s else environment for one in sides for environment in self.environments]
        optics = [one.optics for one in sides for _ in self.environments]
        return {"band": "infrared", "environments": seen, "optics": optics}

    def shine(self, rigs: NDArray[np.float64]) -> None:
        """Lets the projectors, and what else is on the rigs, shine from there."""
        self._rigs = rigs
        self.inputs()
        self.in_scene.shine(rigs)

    def darken(self) -> None:
        """Ends that, so that other sensors do not see them."""
        if not self.config.projector_always_on:
            self.in_scene.darken()

    # ---- what changes ----

    def begin(self, frame: int) -> EngineInputs:
        """The inputs of a picture."""
        self._frame = frame
        if self.config.emitter == "alternating":
            self._inputs = None
        return self.inputs()

    def set_config(self, config: StereoDepthSensorConfig) -> None:
        self.config, self._inputs = config, None

    def setting(self) -> Setting:
        """The exposure and gain that there are."""
        return Setting(self.config.ir_camera_exposure, self.config.ir_camera_gain)

    def set_exposure(self, setting: Setting) -> None:
        if setting != self.setting():
            self.config.ir_camera_exposure, self.config.ir_camera_gain = setting.exposure_s, setting.gain
            self._inputs = exposed_anew(self._inputs, self.config, self._effects, self._scene_measurement)

    def set_twist(self, twist: NDArray[np.float64]) -> None:
        """[6] m/s and rad/s of the left infrared camera in its own axes, of one sensor."""
        self.twist = twist
        if self._inputs is None or any(side.delay_s for side in self._inputs.sides):
            self._inputs = None
            return
        give_velocity(self._inputs, self.config, twist)
        self._rgb_cameras = [self._rgb_camera()]

    def set_conditions(self, temperature_c: float | None, time_s: float) -> None:
        if self._conditions != (temperature_c, time_s):
            self._conditions, self._inputs = (temperature_c, time_s), None

    def leave(self) -> None:
        """Takes what the sensors have in the scene out of it."""
        self.in_scene.leave()
        self._is_closed = True

    # ---- inside ----

    def _rgb_camera(self) -> kuafu.Camera:
        c, (width, height) = self.config, self.config.rgb_resolution
        linear, angular = twist_of(c, self.twist, Pose())
        return kuafu.Camera(
            width, height, c.rgb_intrinsic, linear_velocity=linear, angular_velocity=angular,
            exposure_s=c.rgb_exposure_s, **lens_fields(c.rgb_distortion), **shutter(c.rgb_line_time_s, c.rgb_readout),
        )  # fmt: skip

    def _refuse(self, inputs: EngineInputs) -> None:
        """ValueError for effects that these sensors have not."""
        names = [] if self._takes_image_effects else [effect.id for effect, _ in self.left_over]
        names += ["exposure_desync"] if inputs.right.delay_s and not self.is_one else []
        if names:
            raise ValueError(
                f"such sensors have no {', '.join(names)}: a StereoDepthSensor has, without on_cuda and pipelined"
            )
