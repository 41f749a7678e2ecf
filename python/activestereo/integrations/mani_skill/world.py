# SPDX-License-Identifier: Apache-2.0
"""Mirrors a ManiSkill scene, with all its parallel environments, in one kuafu scene."""

from __future__ import annotations

import weakref
from dataclasses import replace
from typing import Any

import torch

import kuafu
from activestereo.integrations.sapien.shapes import Looks, is_visible, light_record, render_system
from activestereo.scene_io.bodies import Bodies, Shape
from activestereo.sensor.pictures import PipelinedSensors

_AMBIENT = (0.3, 0.3, 0.3)


class ManiSkillWorld:
    """Mirrors the actors and links of a ManiSkillScene in `scene`, a kuafu.Scene with an environment for each parallel
    scene.

    Poses come from ManiSkill's own batched structs, so a simulation on a GPU gathers them there and the host reads them
    once. Hidden objects are left out. The ambient light is the first scene's. device: 'auto', 'cpu' or an index.
    """

    _known: weakref.WeakValueDictionary[int, ManiSkillWorld] = weakref.WeakValueDictionary()

    def __init__(self, scene: Any, device: str | int = "auto") -> None:
        if scene.parallel_in_single_scene:
            raise ValueError("parallel_in_single_scene: environments side by side in one scene see each other")
        self.mani_skill_scene = scene
        self.scene = kuafu.Scene(kuafu.Device(device))
        self.count = len(scene.sub_scenes)
        self.bodies = Bodies(self.scene, self.count)
        self._looks = Looks(self.scene)
        self.pipelined = PipelinedSensors()
        # For each body, in order: ManiSkill's struct, and the environments of its objects.
        self._places: dict[str, tuple[Any, list[int]]] = {}
        self.scene.set_environment(_AMBIENT)
        for environment, sub_scene in enumerate(scene.sub_scenes):
            system = render_system(sub_scene)
            if system is None:
                continue
            if environment == 0:
                self.scene.set_environment(tuple(system.ambient_light))
            for light in system.lights:
                record = light_record(light, environment)
                if record is not None:
                    self.scene.add_light(record)
        self.update()
        ManiSkillWorld._known[id(scene)] = self

    @classmethod
    def for_scene(cls, scene: Any, device: str | int = "auto") -> ManiSkillWorld:
        """Returns the world that mirrors a ManiSkill scene; makes one at the first call."""
        known = cls._known.get(id(scene))
        return cls(scene, device) if known is None or known.mani_skill_scene is not scene else known

    def update(self) -> int:
        """Waits for the `pipelined` sensors' pictures and moves the scene to ManiSkill's present state. Returns the
        number of shapes that moved. Raises BodyPoseError, with environment and body, if a state has turned NaN; the
        other environments have moved."""
        self.pipelined.wait()
        structs = list(self.mani_skill_scene.actors.items())  # by unique names
        for name, articulation in self.mani_skill_scene.articulations.items():
            structs += [(f"{name}: {link.name}", link) for link in articulation.links]
        seen = {id(struct): (name, struct) for name, struct in structs if not getattr(struct, "hidden", False)}
        for name in [name for name, (struct, _) in self._places.items() if id(struct) not in seen]:
            self.bodies.remove(name)
            del self._places[name]
        known = {id(struct) for struct, _ in self._places.values()}
        for number in [number for number in seen if number not in known]:
            name, struct = seen[number]
            # A struct's objects share their geometry; each environment has its own materials.
            entities = [getattr(thing, "entity", thing) for thing in struct._objs]
            environments = struct._scene_idxs.tolist()
            own: dict[int, list[Shape]] = {}
            if is_visible(entities[0]):
                first = self._looks.shapes(entities[0], name)
                for environment, entity in zip(environments, entities, strict=True):
                    materials = self._looks.materials(entity)
                    own[environment] = [replace(s, materials=[m]) for s, m in zip(first, materials, strict=True)]
            self.bodies.add(name, own, semantic_id=entities[0].per_scene_id)
            self._places[name] = (struct, environments)
        # Poses [E, bodies, 7] on the simulation's device.
        device = self.mani_skill_scene.device
        out = torch.zeros((self.count, len(self._places), 7), device=device)
        out[..., 3] = 1.0
        for body, (struct, environments) in enumerate(self._places.values()):
            out[environments, body] = struct.pose.raw_pose.to(out)
        return self.bodies.move(out)
