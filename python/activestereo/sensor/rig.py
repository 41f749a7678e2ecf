# SPDX-License-Identifier: Apache-2.0
"""Places the sensors' objects in a scene: projectors, and a model's lights, materials and medium. leave() removes all
of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.plan import Pattern
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.engines.world import copy_light, copy_record, enter_world

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
    """Owns the lights and materials that equal sensors add to their scene. environments: each sensor's, whose cameras
    alone see its lights; None: all do. A model's materials hold until leave(). laser_power: [sensors], factors on the
    projector's power."""

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
        without a float32 record's rounding. pattern: the projector's pattern before any effect."""
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
            # The right camera opens at another time, so it sees an environment of its own with the rig moved on.
            instants = [([0], 0.0), ([LATER], inputs.right.delay_s)]
        for light in (*own, *inputs.rig_lights):
            infrared = laser_w_sr if light.ir_intensity == np.float32(laser_w_sr) else light.ir_intensity
            for environments, delay_s in instants:
                # The first record is the inputs' own, which follows the rig's velocity.
                records = [copy_light(light, delay_s) if n or delay_s else light for n in range(len(environments))]
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
