# SPDX-License-Identifier: Apache-2.0
"""Computes the inputs of both engines for equal sensors from plan, model, velocity and conditions, with their cameras
and lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import Setting
from activestereo.camera.plan import SensorPlan
from activestereo.capture.capture import Frame
from activestereo.common.pose import Pose, camera_to_world, carried_twist
from activestereo.effects.core.descriptor import Effect
from activestereo.effects.core.engine import EngineCamera, EngineInputs, apply_engine, moved_pose
from activestereo.effects.core.model import Model
from activestereo.effects.core.scene_surfaces import split_surfaces
from activestereo.effects.engines.capture_inputs import SceneMeasurement
from activestereo.effects.engines.world import copy_camera
from activestereo.model import SensorModel, read_model
from activestereo.sensor.rig import LATER, Rig

# A medium extends beyond scene and sensor by this margin.
_MARGIN_M = 0.05


class RigInputs:
    """Computes what renderer and depth engine need for equal sensors: cameras, lights, materials, parameters.
    Recomputes it after a change. environments, model, source: as in SensorEngine. takes_image_effects: whether effects
    are allowed that neither engine computes. Raises ValueError for a model that does not fit."""

    def __init__(
        self, plan: SensorPlan, scene: kuafu.Scene, environments: Sequence[int | None],
        model: SensorModel | str | PathLike[str] | None, source: object, takes_image_effects: bool,
    ) -> None:  # fmt: skip
        self.plan, self.setting = plan, plan.exposure.start
        self.scene, self.is_one = scene, list(environments) == [None]
        # The environment that each sensor's cameras see.
        self.environments = [environment or 0 for environment in environments]
        self._takes_image_effects = takes_image_effects
        self._effects, self._scene_measurement, ambient_dn = _fit_model(scene, source, model)
        self._ambient_radiance = plan.ambient_radiance if ambient_dn is None else ambient_dn / plan.responsivity_dn
        self.in_scene = Rig(scene, environments)
        # The effects that act outside of the engines.
        self.left_over: tuple[tuple[Effect, dict[str, float]], ...] = ()
        self.twist = np.zeros(6)
        self._conditions: tuple[float | None, float] = (None, 0.0)
        self.right_turn: NDArray[np.float64] | None = None  # [sensors, 4, 4]: how the right cameras are turned
        self._frame = 0
        self._rigs: NDArray[np.float64] | None = None
        self._is_closed = False
        self._inputs: EngineInputs | None = self._compute_inputs()

    def inputs(self) -> EngineInputs:
        """Returns the parameters of renderer and depth engine under the model, with the RGB camera at the origin.
        Recomputes them after a change of sensor or conditions."""
        if self._inputs is None:
            inputs = self._compute_inputs()
            if not self._is_closed:
                self._enter_scene(inputs)
            self._inputs = inputs
        return self._inputs

    def enter(self) -> None:
        """Puts the sensors' projectors, lights and cameras into the scene. Takes all of them out again and raises if
        one fails."""
        try:
            self._enter_scene(self.inputs())
        except BaseException:
            self.in_scene.leave()
            raise

    def make_matcher(self, count: int) -> simsense.Engine:
        """Returns a new depth engine that matches `count` pairs at a time."""
        device = simsense.Device(self.scene.device)
        told: dict[str, Any] = self.plan.engine | self.setting.applied_to(self.plan.signal)
        engine = simsense.Engine(device, batch_count=count, **told)
        engine.set_signal(*self.signals())
        return engine

    def signals(self) -> list[dict[str, float]]:
        """Returns the imagers' parameters, left then right, by simsense's names."""
        return [side.signal for side in self.inputs().sides]

    def ir_cameras(self, rigs: NDArray[np.float64]) -> list[kuafu.Camera]:
        """Returns all left cameras, then all right ones, at their true places; a model may move them off the
        calibration. rigs: the RGB cameras' poses, [sensors, 4, 4], body axes."""
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
        """Returns the arguments of kuafu.Renderer.render that hold for the RGB cameras alone: band, environments,
        optics."""
        return {"band": "visible", "environments": self.environments, "optics": self.plan.rgb_optics}

    def infrared(self, side: int | None = None) -> dict[str, Any]:
        """Returns the arguments of kuafu.Renderer.render that hold for the infrared cameras alone: band, environments,
        optics. side: 0 (left) or 1 (right); None: both."""
        sides = self.inputs().sides if side is None else [self.inputs().sides[side]]
        seen = [LATER if one.delay_s else environment for one in sides for environment in self.environments]
        optics = [one.optics for one in sides for _ in self.environments]
        return {"band": "infrared", "environments": seen, "optics": optics}

    def shine(self, rigs: NDArray[np.float64]) -> None:
        """Switches the projectors and the model's lights on the rigs on. rigs: the RGB cameras' poses, [sensors, 4, 4],
        body axes."""
        self._rigs = rigs
        self.inputs()
        self.in_scene.shine(rigs)

    def darken(self) -> None:
        """Switches the lights of shine() off, so that other sensors do not see them, unless the projector is always
        on."""
        if not self.plan.projector_always_on:
            self.in_scene.darken()

    # ---- settings between pictures ----

    def begin(self, frame: int) -> EngineInputs:
        """Returns the inputs for picture number `frame`. They differ between pictures if the laser's power
        alternates."""
        self._frame = frame
        if len(set(self.plan.laser_w_sr)) > 1:
            self._inputs = None
        return self.inputs()

    def set_plan(self, plan: SensorPlan) -> None:
        self.plan, self._inputs = plan, None

    def set_exposure(self, setting: Setting) -> None:
        """Sets exposure and gain. Recomputes all inputs if there are effects or a scene measurement, which may depend
        on the exposure."""
        if setting == self.setting:
            return
        self.setting = setting
        if self._inputs is None or self._effects.effects or self._scene_measurement != SceneMeasurement():
            self._inputs = None
            return
        self._inputs.frame = replace(self._inputs.frame, exposure_s=setting.exposure_s)
        for side in self._inputs.sides:
            side.signal, side.camera.exposure_s = self._signal(), setting.exposure_s

    def set_twist(self, twist: NDArray[np.float64]) -> None:
        """Sets the velocity of a single sensor: [6], m/s and rad/s of the left infrared camera in its own axes."""
        self.twist = twist
        if self._inputs is None or any(side.delay_s for side in self._inputs.sides):
            self._inputs = None
            return
        self._give_velocity(self._inputs)
        self._rgb_cameras = [self._rgb_camera()]

    def set_conditions(self, temperature_c: float | None, time_s: float) -> None:
        if self._conditions != (temperature_c, time_s):
            self._conditions, self._inputs = (temperature_c, time_s), None

    def leave(self) -> None:
        """Removes the sensors' objects from the scene."""
        self.in_scene.leave()
        self._is_closed = True

    # ---- inside ----

    def _enter_scene(self, inputs: EngineInputs) -> None:
        self.in_scene.enter(inputs, self.plan.laser_w_sr[self._frame % 2], self.plan.pattern)
        if self.plan.projector_always_on and self._rigs is not None:
            self.in_scene.shine(self._rigs)

    def _compute_inputs(self) -> EngineInputs:
        """Computes the inputs under the model, and the cameras from them. Raises ValueError for effects that these
        sensors do not support."""
        # 1. The inputs without effects.
        plan, exposure_s, laser_w_sr = self.plan, self.setting.exposure_s, self.plan.laser_w_sr[self._frame % 2]
        temperature_c, time_s = self._conditions
        frame = Frame(
            id=0, left_path=None, right_path=None, timestamp_s=time_s, exposure_s=exposure_s,
            camera_to_world=np.eye(4), split="train", temperature_c=temperature_c, camera_velocity=self.twist,
        )  # fmt: skip
        left, right = (
            EngineCamera(
                kuafu.Camera(**camera, exposure_s=exposure_s), kuafu.Optics(**plan.ir_optics), self._signal(), is_right
            )
            for camera, is_right in ((plan.left, False), (plan.right, True))
        )
        summary = self.scene.summary
        corners = [summary.bounds_min_m, summary.bounds_max_m] if summary.triangle_count else []
        box = np.array([*corners, np.zeros(3)])  # corners of a box around the scene and the sensor
        inputs = EngineInputs(
            left=left,
            right=right,
            projector=None if plan.projector is None else kuafu.Light(**plan.projector, ir_intensity=laser_w_sr),
            pattern=plan.pattern and plan.pattern.radiant,
            frame=frame,
            new_light=kuafu.Light,
            new_medium=kuafu.Medium,
            scene_materials=self.in_scene.material,
            material_count=summary.material_count,
            bounds_m=(tuple(box.min(axis=0) - _MARGIN_M), tuple(box.max(axis=0) + _MARGIN_M)),
            max_dn=float(2 ** int(plan.signal["bit_depth"]) - 1),
            seed=plan.engine["noise_seed"],
            ambient_radiance=self._ambient_radiance,
            speckle_of_laser=plan.speckle_of_laser,
        )
        self._give_velocity(inputs)
        # 2. The scene measurement's and the effects' changes.
        self._scene_measurement.apply(inputs)
        self.left_over = apply_engine(inputs, self._effects.effects)
        names = [] if self._takes_image_effects else [effect.id for effect, _ in self.left_over]
        names += ["exposure_desync"] if inputs.right.delay_s and not self.is_one else []
        if names:
            raise ValueError(
                f"such sensors have no {', '.join(names)}: a StereoDepthSensor has, without on_cuda and pipelined"
            )
        # 3. The cameras.
        cameras = [(side.camera, side.delay_s) for side in inputs.sides]
        self._cameras_on_rig = [
            moved_pose(e.camera_to_world, e.linear_velocity, e.angular_velocity, t) for e, t in cameras
        ]
        others = self.environments[1:]
        self._ir_cameras = [[camera, *(copy_camera(camera, 0.0) for _ in others)] for camera, _ in cameras]
        self._rgb_cameras = [self._rgb_camera() for _ in self.environments]
        return inputs

    def _signal(self) -> dict[str, float]:
        temperature_c, signal = self._conditions[0], self.setting.applied_to(self.plan.signal)
        return signal if temperature_c is None else signal | {"temperature_c": temperature_c}

    def _twist_of(self, name: str) -> NDArray[np.float64]:
        """Returns [2, 3], linear and angular velocity (m/s, rad/s) of a part of the rig, such as "rgb", in its own
        camera axes."""
        if not np.any(self.twist):  # the usual case; automatic exposure asks at each picture
            return np.zeros((2, 3))
        return carried_twist(self.plan.left_to[name], self.twist).reshape(2, 3)

    def _give_velocity(self, inputs: EngineInputs) -> None:
        """Sets the velocities of the infrared cameras and of the sensor's lights in `inputs`. They follow from the left
        camera's, because the sensor is rigid."""
        for record, name in ((inputs.left.camera, "left"), (inputs.right.camera, "right")):
            record.linear_velocity, record.angular_velocity = self._twist_of(name)
        for light in ([] if inputs.projector is None else [inputs.projector]) + inputs.rig_lights:
            light.linear_velocity, light.angular_velocity = self._twist_of("projector")

    def _rgb_camera(self) -> kuafu.Camera:
        linear, angular = self._twist_of("rgb")
        return kuafu.Camera(**self.plan.rgb, linear_velocity=linear, angular_velocity=angular)


def _fit_model(
    scene: kuafu.Scene, source: object, model: SensorModel | str | PathLike[str] | None
) -> tuple[Model, SceneMeasurement, float | None]:
    """Assigns a model's values to this scene's materials by name. Returns (effects, scene measurement, ambient infrared
    light of the model's room in counts or None). source: the scene file's path, or any other object. With a path, each
    object that the model tells from others of its material gets its own material."""
    if model is None:
        return Model(), SceneMeasurement(), None
    model = model if isinstance(model, SensorModel) else read_model(Path(model))
    names = [scene.material_name(number) for number in range(scene.summary.material_count)]
    if isinstance(source, (str, PathLike)) and not model.surfaces <= set(names):
        split_surfaces(scene, Path(source))
        names = [scene.material_name(number) for number in range(scene.summary.material_count)]
    ambient = model.nuisances.get("ambient_scale")
    return model.bound(names), model.scene_measurement(names), None if ambient is None else ambient.value
