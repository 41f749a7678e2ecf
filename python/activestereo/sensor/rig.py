# SPDX-License-Identifier: Apache-2.0
"""Places the sensors' objects in a scene: projectors, and a model's lights, materials and medium. Computes what the
renderer and the depth engine get."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
import simsense
from activestereo.camera.auto_exposure import Setting
from activestereo.camera.plan import Pattern, SensorPlan
from activestereo.capture.capture import Frame
from activestereo.common.pose import Pose, camera_to_world, carried_twist
from activestereo.effects.core.descriptor import Effect
from activestereo.effects.core.engine import EngineCamera, EngineInputs, apply_engine
from activestereo.effects.core.model import Model
from activestereo.effects.core.surfaces import split_surfaces_named
from activestereo.effects.engines.capture_inputs import (
    SceneMeasurement,
    bounds_around,
    copy_later,
    copy_record,
    enter_world,
)
from activestereo.model import SensorModel, read_model

# Number of the environment that the right camera sees if its shutter opens later than the left one's.
LATER = 1


@dataclass
class _RigLight:
    """A light that moves with the sensors: their projector or a model's light. records: one kuafu.Light for each
    sensor. on_rig: 4x4, its pose relative to the RGB camera. visible, infrared: its intensities while it is on."""

    records: list[kuafu.Light]
    on_rig: NDArray[np.float64]
    visible: tuple[float, float, float]
    infrared: float | None
    is_laser: bool


class Rig:
    """Owns the lights and materials that equal sensors add to their scene. environments: number of each sensor's
    environment, whose cameras alone see its lights; None: all cameras do. A model's changes of materials last until
    leave(). laser_power: [sensors], factors on the projector's power."""

    def __init__(self, scene: kuafu.Scene, environments: Sequence[int | None]) -> None:
        self._scene, self._environments = scene, environments
        self.laser_power = np.ones(len(environments))
        self._texture: int | None = None
        self._changed_texture: int | None = None
        self._materials: dict[int, kuafu.Material] = {}
        self._has_medium = False
        self._on_rig: list[_RigLight] = []
        self._numbers: list[int] = []  # numbers of the moving lights in the scene
        self._standing: list[int] = []

    @property
    def projector(self) -> int | None:
        """Returns the number of the first sensor's projector among the scene's lights, or None."""
        return self._numbers[0] if self._on_rig and self._on_rig[0].is_laser else None

    def material(self, number: int) -> kuafu.Material:
        """Returns a new copy of the scene's material of this number, as it is without the effects' changes."""
        if number not in self._materials:
            return self._scene.get_material(number)
        return copy_record(self._materials[number])

    def enter(self, inputs: EngineInputs, laser_w_sr: float, pattern: Pattern | None) -> None:
        """Puts the lights, materials and medium of `inputs` into the scene, in place of an earlier call's. Lights that
        move with the sensors stay dark until shine(). laser_w_sr: the projector's intensity before any effect, W/sr,
        which a kuafu.Light rounds to float32. pattern: the projector's pattern before any effect."""
        self._leave_but_pattern()
        own = [] if inputs.projector is None else [inputs.projector]
        for light in (*own, *inputs.rig_lights, *inputs.lights):
            if light.kind == "projector" and pattern is not None and not len(light.dots):
                seen = inputs.pattern
                if seen is None or seen is pattern.radiant or np.array_equal(seen, pattern.radiant):
                    if self._texture is None:
                        self._texture = self._scene.add_texture(pattern.image, name="projector pattern")
                    light.texture = self._texture
                    continue
                if self._changed_texture is None:  # effects changed the pattern
                    changed = np.ascontiguousarray(seen, np.float32)
                    self._changed_texture = self._scene.add_texture(changed, name="changed projector pattern")
                light.texture = self._changed_texture
        self._materials = {number: self._scene.get_material(number) for number in inputs.materials}
        self._has_medium = inputs.medium is not None
        enter_world(self._scene, inputs)
        instants = [(self._environments, 0.0)]
        if inputs.right.delay_s:
            # The right camera's shutter opens later: it renders another environment, in which the rig has moved.
            instants = [([0], 0.0), ([LATER], inputs.right.delay_s)]
        for light in (*own, *inputs.rig_lights):
            infrared = laser_w_sr if light.ir_intensity == np.float32(laser_w_sr) else light.ir_intensity
            for environments, delay_s in instants:
                # The first record is the inputs' own, which follows the rig's velocity.
                records = [copy_later(light, delay_s) if n or delay_s else light for n in range(len(environments))]
                for record, environment in zip(records, environments, strict=True):
                    record.environment = environment
                    self._numbers.append(self._scene.add_light(record))
                self._on_rig.append(
                    _RigLight(records, records[0].light_to_world, light.intensity, infrared, light is inputs.projector)
                )
        self.darken()
        for light in inputs.lights:
            self._standing.append(self._scene.add_light(light))

    def shine(self, rigs: NDArray[np.float64]) -> None:
        """Switches on the lights that move with the sensors, placed for RGB cameras at these poses: [sensors, 4, 4],
        body axes."""
        for one in self._on_rig:
            shares = self.laser_power.tolist() if one.is_laser else [1.0] * len(rigs)
            for record, place, share in zip(one.records, rigs @ one.on_rig, shares, strict=True):
                record.light_to_world, record.intensity = place, one.visible
                record.ir_intensity = None if one.infrared is None else one.infrared * share
        self._set_lights()

    def darken(self) -> None:
        """Switches the lights that move with the sensors off until shine()."""
        for one in self._on_rig:
            for record in one.records:
                record.intensity, record.ir_intensity = (0.0, 0.0, 0.0), 0.0
        self._set_lights()
        for one in self._on_rig:  # the inputs' own records hold the lights' values
            one.records[0].intensity, one.records[0].ir_intensity = one.visible, one.infrared

    def leave(self) -> None:
        """Removes everything that enter() added from the scene, and restores the scene's materials."""
        self._leave_but_pattern()
        if self._texture is not None:
            self._scene.remove_texture(self._texture)
        self._texture = None

    def _set_lights(self) -> None:
        self._scene.set_lights(self._numbers, [record for one in self._on_rig for record in one.records])

    def _leave_but_pattern(self) -> None:
        """Removes everything but the pattern's texture, which enter() uses again."""
        for number in (*self._numbers, *self._standing):
            self._scene.remove_light(number)
        if self._changed_texture is not None:
            self._scene.remove_texture(self._changed_texture)
        for number, material in self._materials.items():
            self._scene.set_material(number, material)
        if self._has_medium:
            self._scene.set_medium(None)
        self._on_rig, self._numbers, self._standing, self._materials = [], [], [], {}
        self._changed_texture, self._has_medium = None, False


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
        self._ambient_radiance = plan.config.ir_ambient_radiance
        if ambient_dn is not None:
            self._ambient_radiance = ambient_dn / plan.config.ir_responsivity_dn
        self.in_scene = Rig(scene, environments)
        # Pairs (effect, parameters) that neither renderer nor depth engine computes.
        self.left_over: tuple[tuple[Effect, dict[str, float]], ...] = ()
        self.twist = np.zeros(6)
        self._conditions: tuple[float | None, float] = (None, 0.0)
        self.right_turn = np.tile(np.eye(4), (len(environments), 1, 1))  # [sensors, 4, 4], of the right cameras
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
        """Puts the sensors' projectors, lights and cameras into the scene. If one fails, removes all of them again and
        raises."""
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
        """Returns all left cameras, then all right ones, at their true poses, which a model may move off the
        calibration. rigs: the RGB cameras' poses, [sensors, 4, 4], body axes."""
        self.inputs()
        left, right = (rigs @ side for side in self._cameras_on_rig)
        views = np.concatenate([left, right @ self.right_turn])
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
        return {"band": "visible", "environments": self.environments, "optics": self.plan.config.rgb_optics}

    def infrared(self, side: int | None = None) -> dict[str, Any]:
        """Returns the arguments of kuafu.Renderer.render that hold for the infrared cameras alone: band, environments,
        optics. side: 0 (left) or 1 (right); None: both."""
        sides = self.inputs().sides if side is None else [self.inputs().sides[side]]
        seen = [LATER if one.delay_s else environment for one in sides for environment in self.environments]
        optics = [one.optics for one in sides for _ in self.environments]
        return {"band": "infrared", "environments": seen, "optics": optics}

    def shine(self, rigs: NDArray[np.float64]) -> None:
        """Switches on the projectors and the model's lights that move with the sensors. rigs: the RGB cameras' poses,
        [sensors, 4, 4], body axes."""
        self._rigs = rigs
        self.inputs()
        self.in_scene.shine(rigs)

    def darken(self) -> None:
        """Switches off the lights that shine() switched on, so that other sensors do not see them. Does nothing if the
        projector is always on."""
        if not self.plan.config.projector_always_on:
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

    def set_seed(self, seed: int) -> None:
        """Seeds render, noise and the effects' draws."""
        self.plan = replace(self.plan, render_seed=seed, engine=self.plan.engine | {"noise_seed": seed})
        if self._effects.effects:
            self._inputs = None
        elif self._inputs is not None:
            self._inputs.seed = seed

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
        self.require_open()
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

    def require_open(self) -> None:
        """Raises RuntimeError after leave()."""
        if self._is_closed:
            raise RuntimeError("the sensor is closed and its projector has left the scene: make a new sensor")

    # ---- inside ----

    def _enter_scene(self, inputs: EngineInputs) -> None:
        self.in_scene.enter(inputs, self.plan.laser_w_sr[self._frame % 2], self.plan.pattern)
        if self.plan.config.projector_always_on and self._rigs is not None:
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
                kuafu.Camera(**camera, exposure_s=exposure_s),
                kuafu.Optics(**(plan.config.ir_optics or {})),
                self._signal(),
            )  # fmt: skip
            for camera in (plan.left, plan.right)
        )
        inputs = EngineInputs(
            left=left,
            right=right,
            projector=None if plan.projector is None else kuafu.Light(**plan.projector, ir_intensity=laser_w_sr),
            pattern=plan.pattern and plan.pattern.radiant,
            frame=frame,
            scene_materials=self.in_scene.material,
            material_count=self.scene.summary.material_count,
            bounds_m=bounds_around(self.scene, [np.zeros(3)]),
            max_dn=float(2 ** int(plan.signal["bit_depth"]) - 1),
            seed=plan.engine["noise_seed"],
            ambient_radiance=self._ambient_radiance,
            speckle_of_laser=bool(plan.config.ir_speckle_of_laser),
        )
        self._give_velocity(inputs)
        # 2. The scene measurement's and the effects' changes.
        self._scene_measurement.apply(inputs)
        self.left_over = apply_engine(inputs, self._effects.effects)
        names = [] if self._takes_image_effects else [effect.id for effect, _ in self.left_over]
        names += ["exposure_desync"] if inputs.right.delay_s and not self.is_one else []
        if names:
            raise ValueError(f"such sensors have no {', '.join(names)}: a StereoDepthSensor has, without on_cuda")
        # 3. The cameras.
        cameras = [(side.camera, side.delay_s) for side in inputs.sides]
        self._cameras_on_rig = [copy_later(camera, delay_s).camera_to_world for camera, delay_s in cameras]
        others = self.environments[1:]
        self._ir_cameras = [[camera, *(copy_record(camera) for _ in others)] for camera, _ in cameras]
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
    light of the model's room in counts or None). source: the scene file's path, or any other object. With a path,
    objects of one material that the model distinguishes get separate materials."""
    if model is None:
        return Model(), SceneMeasurement(), None
    model = model if isinstance(model, SensorModel) else read_model(Path(model))
    if isinstance(source, (str, PathLike)):
        split_surfaces_named(scene, Path(source), model.surfaces)
    names = [scene.material_name(number) for number in range(scene.summary.material_count)]
    ambient = model.nuisances.get("ambient_scale")
    return model.bound(names), model.scene_measurement(names), None if ambient is None else ambient.value
