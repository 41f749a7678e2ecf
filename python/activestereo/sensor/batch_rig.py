# SPDX-License-Identifier: Apache-2.0
"""What a batch of like sensors has in its scene: infrared cameras, projectors and a model's effects, for each sensor in
its environment."""

from __future__ import annotations

import weakref

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import Pose
from activestereo.effects.core.engine import EngineInputs, apply_engine
from activestereo.effects.engines.world import copy_camera, copy_light, enter_world
from activestereo.model import SensorModel
from activestereo.sensor.inputs import exposure, sensor_inputs
from activestereo.sensor.world import pattern_of


class BatchRig:
    """environments: of each sensor. inputs: the engines' inputs for each. Lights are dark until shine()."""

    def __init__(
        self,
        config: StereoDepthSensorConfig,
        scene: kuafu.Scene,
        environments: list[int],
        model: SensorModel | None = None,
    ) -> None:
        self._scene = scene
        pattern = config.pattern() if config.light_dots is None else None
        image = None if pattern is None else pattern[0]
        self.inputs = _inputs_of(config, scene, None if image is None else pattern_of(image), model)
        eyes = self.inputs.sides
        self.cameras = [copy_camera(eye.camera, 0.0) for eye in eyes for _ in environments]
        self.optics = [eye.optics for eye in eyes for _ in environments]
        self._eyes_on_rig = [eye.camera.camera_to_world for eye in eyes]
        # Of each sensor: the laser's power over the configuration's, and how its right eye is turned.
        self.laser_power = np.ones(len(environments))
        self.right_turn = np.broadcast_to(np.eye(4), (len(environments), 4, 4)).copy()
        materials = {number: scene.get_material(number) for number in self.inputs.materials}
        has_medium = self.inputs.medium is not None
        own_lights: list[int] = []
        own_textures: list[int] = []
        self.leave = weakref.finalize(self, _leave, scene, own_lights, own_textures, materials, has_medium)
        self.leave.atexit = False
        own = [] if self.inputs.projector is None else [self.inputs.projector]
        self._projectors = len(own) * len(environments)  # the first of the lights
        self._lights: list[kuafu.Light] = []
        self._on_rig = [light.light_to_world for light in (*own, *self.inputs.rig_lights)]
        power = [float(light.ir_intensity or 0.0) for light in (*own, *self.inputs.rig_lights) for _ in environments]
        nominal = config.projector_intensity
        self._power = [nominal if p == np.float32(nominal) else p for p in power]  # unrounded where it is the config's
        for light in (*own, *self.inputs.rig_lights):
            for environment in environments:
                placed = copy_light(light)
                placed.environment, placed.ir_intensity = environment, 0.0
                self._lights.append(placed)
        try:
            enter_world(scene, self.inputs)
            texture = _texture(scene, self.inputs, image)
            if texture is not None:
                own_textures.append(texture)
                for light in self._lights:
                    if light.kind == "projector" and not len(light.dots):
                        light.texture = texture
            for light in (*self._lights, *self.inputs.lights):
                own_lights.append(scene.add_light(light))
        except BaseException:
            self.leave()
            raise
        self._numbers = own_lights[: len(self._lights)]

    def place(self, rigs: NDArray[np.float64]) -> None:
        """rigs: [count, 4, 4], body axes."""
        left, right = self._eyes_on_rig
        views = np.concatenate([rigs @ left, rigs @ right @ self.right_turn])
        for camera, view in zip(self.cameras, views, strict=True):
            camera.camera_to_world = view
        if self._lights:
            for light, place in zip(self._lights, np.concatenate([rigs @ p for p in self._on_rig]), strict=True):
                light.light_to_world = place

    def shine(self, share: float) -> None:
        """The lights of all rigs, of their nominal power; where place() has put them."""
        own = [*self.laser_power[: self._projectors].tolist(), *[1.0] * (len(self._lights) - self._projectors)]
        for light, power, laser in zip(self._lights, self._power, own, strict=True):
            light.ir_intensity = power * share * laser
        self._scene.set_lights(self._numbers, self._lights)


def _inputs_of(
    config: StereoDepthSensorConfig, scene: kuafu.Scene, image: NDArray[np.float32] | None, model: SensorModel | None
) -> EngineInputs:
    """With the RGB camera at the origin. ValueError where the model does not fit the scene or a batch."""
    still, radiance = np.zeros(6), config.ir_ambient_radiance
    ambient = None if model is None else model.nuisances.get("ambient_scale")
    if ambient is not None:
        radiance = ambient.value / config.ir_responsivity_dn
    inputs = sensor_inputs(config, scene, Pose(), still, exposure(config, still), image, radiance)
    if model is None:
        return inputs
    names = [scene.material_name(number) for number in range(scene.summary.material_count)]
    model.scene_measurement(names).apply(inputs)
    left_over = [effect.id for effect, _ in apply_engine(inputs, model.bound(names).effects)]
    left_over += ["exposure_desync"] if any(eye.delay_s for eye in inputs.sides) else []
    if left_over:
        what = ", ".join(left_over)
        raise ValueError(f"a batch has no {what}: StereoDepthSensor has effects that act outside of the engines")
    return inputs


def _texture(scene: kuafu.Scene, inputs: EngineInputs, image: NDArray[np.uint8] | None) -> int | None:
    """What the projectors throw: the sensor's own image, or what effects made of it."""
    if inputs.projector is None or image is None or inputs.pattern is None:
        return None
    if np.array_equal(inputs.pattern, pattern_of(image)):
        return scene.add_texture(image, name="projector pattern")
    return scene.add_texture(np.ascontiguousarray(inputs.pattern, np.float32), name="changed projector pattern")


def _leave(
    scene: kuafu.Scene, lights: list[int], textures: list[int], materials: dict[int, kuafu.Material], has_medium: bool
) -> None:
    for number in lights:
        scene.remove_light(number)
    for texture in textures:
        scene.remove_texture(texture)
    for number, material in materials.items():
        scene.set_material(number, material)
    if has_medium:
        scene.set_medium(None)
