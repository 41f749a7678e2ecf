# SPDX-License-Identifier: Apache-2.0
"""Mirrors a live SAPIEN scene in a kuafu scene: its visible entities and lights, at their present poses."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
import sapien

import kuafu
from activestereo.common.pose import as_matrix
from activestereo.integrations.sapien.shapes import Looks, is_visible, light_record, render_system
from activestereo.scene_io.bodies import Bodies
from activestereo.sensor.pictures import PipelinedSensors

# Uniform light in a scene with unknown lights, since SAPIEN has no renderer.
_AMBIENT = (0.3, 0.3, 0.3)


class SapienScene:
    """Mirrors the scene's entities and lights. Shapes and materials come from render components if SAPIEN has a
    renderer, else from VisualRecords of activestereo.integrations.sapien.ActorBuilder, else from collision shapes in
    grey.

    update() follows entities that come, go, hide (visibility 0) or move. `scene` is the kuafu.Scene; you may add lights
    and materials to it. device: 'auto', 'cpu', an index or a kuafu.Device.
    """

    _known: weakref.WeakValueDictionary[int, SapienScene] = weakref.WeakValueDictionary()

    def __init__(self, scene: sapien.Scene, device: str | int | kuafu.Device = "auto") -> None:
        self.sapien_scene = scene
        self.scene = kuafu.Scene(device if isinstance(device, kuafu.Device) else kuafu.Device(device))
        self.bodies = Bodies(self.scene)
        self._names: dict[int, str] = {}  # of the scene's entities, by per_scene_id
        self.looks = Looks(self.scene)
        self._lights: list[tuple[Any, int]] = []
        self._ambient: tuple[float, ...] = _AMBIENT
        self.scene.set_environment(_AMBIENT)
        self.pipelined = PipelinedSensors()
        self.update()
        SapienScene._known[id(scene)] = self

    @classmethod
    def for_scene(cls, scene: sapien.Scene) -> SapienScene:
        """Returns the mirror of a SAPIEN scene; makes one at the first call."""
        known = cls._known.get(id(scene))
        return cls(scene) if known is None or known.sapien_scene is not scene else known

    def update(self) -> int:
        """Waits for the `pipelined` sensors' pictures and brings the scene up to date. Returns the number of shapes
        that moved."""
        self.pipelined.wait()
        seen = {entity.per_scene_id: entity for entity in self.sapien_scene.entities if is_visible(entity)}
        for number in [n for n in self._names if n not in seen]:
            self.bodies.remove(self._names.pop(number))
        for number in [n for n in seen if n not in self._names]:
            entity = seen[number]
            name = entity.name or "entity"
            if name in self.bodies.names:
                name = f"{name} ({number})"
            shapes = self.looks.shapes(entity, name)
            self.bodies.add(name, shapes, pose=as_matrix(entity.pose), semantic_id=number)
            self._names[number] = name
        system = render_system(self.sapien_scene)
        if system is not None:
            if self._ambient != (ambient := tuple(system.ambient_light)):
                self.scene.set_environment(ambient)
                self._ambient = ambient
            records = [(light, record) for light in system.lights if (record := light_record(light)) is not None]
            if [light for light, _ in self._lights] != [light for light, _ in records]:
                for _, number in self._lights:
                    self.scene.remove_light(number)
                self._lights = [(light, self.scene.add_light(record)) for light, record in records]
            for (_, number), (_, record) in zip(self._lights, records, strict=True):
                before = self.scene.get_light(number)
                is_there = np.array_equal(before.light_to_world, record.light_to_world)
                if not is_there or before.intensity != record.intensity:
                    self.scene.set_light(number, record)
        # Bodies and names have the same order, because entries are removed and added in both alike.
        poses = [seen[number].pose.to_transformation_matrix() for number in self._names]
        return self.bodies.move(np.array(poses, np.float64).reshape(-1, 4, 4))
