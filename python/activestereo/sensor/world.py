# SPDX-License-Identifier: Apache-2.0
"""What a sensor puts into its scene: the projector, a model's lights, materials and medium; all of it is taken out
again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.engines.world import copy_light, copy_record, enter_world

# The environment of an eye that opens later than the other.
LATER = 1


class SensorWorld:
    """One sensor's part of a scene. Materials that a model changes are the model's until leave()."""

    def __init__(self, scene: kuafu.Scene, pattern: NDArray[np.uint8] | None) -> None:
        self._scene = scene
        self._pattern = pattern
        # The engines' inputs for it; None where the projector has dots or there is none.
        self.pattern = None if pattern is None else pattern_of(pattern)
        self._texture: int | None = None
        self._changed_texture: int | None = None
        self._materials: dict[int, kuafu.Material] = {}
        self._has_medium = self._has_projector = False
        self._on_rig: list[tuple[int, kuafu.Light, NDArray[np.float64]]] = []
        self._standing: list[int] = []

    @property
    def projector(self) -> int | None:
        """The projector's light, None where there is none."""
        return self._on_rig[0][0] if self._on_rig and self._has_projector else None

    def material(self, number: int) -> kuafu.Material:
        """A fresh copy of one of the scene's materials as it was before any model."""
        if number not in self._materials:
            return self._scene.get_material(number)
        return copy_record(self._materials[number])

    def enter(self, inputs: EngineInputs) -> None:
        """Puts the inputs' world into the scene, in place of what this sensor had there. Lights on the rig are dark
        until place()."""
        self._leave_but_pattern()
        self._materials = {number: self._scene.get_material(number) for number in inputs.materials}
        enter_world(self._scene, inputs)
        self._has_medium = inputs.medium is not None
        self._has_projector = inputs.projector is not None
        own = [] if inputs.projector is None else [inputs.projector]
        delay_s = inputs.right.delay_s
        for light in (*own, *inputs.rig_lights):
            self._throw(light, inputs)
            if delay_s:
                # The right eye opens at another time: it looks into an environment of its own, where the rig is by
                # then.
                light.environment, later = 0, copy_light(light, delay_s)
                later.environment = LATER
                self._on_rig.append((self._scene.add_light(light), light, light.light_to_world))
                self._on_rig.append((self._scene.add_light(later), later, later.light_to_world))
            else:
                self._on_rig.append((self._scene.add_light(light), light, light.light_to_world))
        self.darken()
        for light in inputs.lights:
            self._throw(light, inputs)
            self._standing.append(self._scene.add_light(light))

    def place(self, rig_to_world: NDArray[np.float64]) -> None:
        """Moves the lights of the rig along. rig_to_world: 4x4 from the frame in which their own poses are given."""
        for number, light, pose in self._on_rig:
            light.light_to_world = rig_to_world @ pose
            self._scene.set_light(number, light)

    def darken(self) -> None:
        """Switches the lights of the rig off until place()."""
        for number, light, _ in self._on_rig:
            visible, infrared = light.intensity, light.ir_intensity
            light.intensity, light.ir_intensity = (0.0, 0.0, 0.0), 0.0
            self._scene.set_light(number, light)
            light.intensity, light.ir_intensity = visible, infrared

    def leave(self) -> None:
        """Takes everything out of the scene."""
        self._leave_but_pattern()
        if self._texture is not None:
            self._scene.remove_texture(self._texture)
        self._texture = None

    def _leave_but_pattern(self) -> None:
        """The pattern's texture stays, for enter() to use again."""
        for number in (*(entry[0] for entry in self._on_rig), *self._standing):
            self._scene.remove_light(number)
        if self._changed_texture is not None:
            self._scene.remove_texture(self._changed_texture)
        for number, material in self._materials.items():
            self._scene.set_material(number, material)
        if self._has_medium:
            self._scene.set_medium(None)
        self._on_rig, self._standing, self._materials = [], [], {}
        self._changed_texture, self._has_medium, self._has_projector = None, False, False

    def _throw(self, light: kuafu.Light, inputs: EngineInputs) -> None:
        """Gives a projector of an image its texture: the sensor's own one, or what effects made of it."""
        own = self.pattern
        if light.kind != "projector" or self._pattern is None or own is None or len(light.dots):
            return
        pattern = own if inputs.pattern is None else inputs.pattern
        if pattern is own or np.array_equal(pattern, own):
            if self._texture is None:
                self._texture = self._scene.add_texture(self._pattern, name="projector pattern")
            light.texture = self._texture
        else:
            if self._changed_texture is None:
                self._changed_texture = self._scene.add_texture(
                    np.ascontiguousarray(pattern, np.float32), name="changed projector pattern"
                )
            light.texture = self._changed_texture


def pattern_of(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Relative radiant intensity 0..1 of an 8-bit image, which nobody may change in place."""
    pattern = image.astype(np.float32) / np.float32(255.0)
    pattern.flags.writeable = False
    return pattern
