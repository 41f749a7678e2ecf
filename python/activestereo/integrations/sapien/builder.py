# SPDX-License-Identifier: Apache-2.0
"""SAPIEN's ActorBuilder for machines on which SAPIEN finds no rendering device. It records actors' looks for our scene.

SAPIEN then refuses to make a material or a visual shape. This builder has the same methods, with a kuafu.Material or a
colour for materials. Its records travel with the entity, as a component.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sapien
from sapien.wrapper.actor_builder import ActorBuilder as SapienActorBuilder
from sapien.wrapper.actor_builder import VisualShapeRecord

import kuafu


class VisualRecords(sapien.Component):
    """An entity's looks: a list of SAPIEN's VisualShapeRecord with kuafu's materials."""

    def __init__(self, records: Sequence[VisualShapeRecord]) -> None:
        super().__init__()
        self.records = list(records)

    def on_add_to_scene(self, scene: sapien.Scene) -> None:
        """SAPIEN asks for it."""

    def on_remove_from_scene(self, scene: sapien.Scene) -> None:
        """SAPIEN asks for it."""


class ActorBuilder(SapienActorBuilder):
    """ActorBuilder(scene) in place of scene.create_actor_builder()."""

    def __init__(self, scene: sapien.Scene) -> None:
        super().__init__()
        self.set_scene(scene)

    def add_box_visual(
        self, pose: Any = None, half_size: Any = (1, 1, 1), material: Any = None, name: str = ""
    ) -> ActorBuilder:
        return self._record("box", pose, material, name, scale=half_size)

    def add_sphere_visual(
        self, pose: Any = None, radius: float = 1, material: Any = None, name: str = ""
    ) -> ActorBuilder:
        return self._record("sphere", pose, material, name, radius=radius)

    def add_capsule_visual(
        self, pose: Any = None, radius: float = 1, half_length: float = 1, material: Any = None, name: str = ""
    ) -> ActorBuilder:
        return self._record("capsule", pose, material, name, radius=radius, length=half_length)

    def add_cylinder_visual(
        self, pose: Any = None, radius: float = 1, half_length: float = 1, material: Any = None, name: str = ""
    ) -> ActorBuilder:
        return self._record("cylinder", pose, material, name, radius=radius, length=half_length)

    def add_plane_visual(
        self, pose: Any = None, scale: Any = (1, 1, 1), material: Any = None, name: str = ""
    ) -> ActorBuilder:
        return self._record("plane", pose, material, name, scale=scale)

    def add_visual_from_file(
        self, filename: str, pose: Any = None, scale: Any = (1, 1, 1), material: Any = None, name: str = ""
    ) -> ActorBuilder:
        return self._record("file", pose, material, name, filename=str(filename), scale=scale)

    def build_entity(self) -> sapien.Entity:
        entity = sapien.Entity()
        entity.add_component(VisualRecords(self.visual_records))
        entity.add_component(self.build_physx_component())
        entity.name = self.name
        return entity

    def _record(self, kind: str, pose: Any, material: Any, name: str, **shape: Any) -> ActorBuilder:
        pose = sapien.Pose() if pose is None else pose
        if material is not None and not isinstance(material, kuafu.Material):
            colour = (*(float(v) for v in material), 1.0)[:4]
            material = kuafu.Material(base_color=colour)
        self.visual_records.append(VisualShapeRecord(kind, pose=pose, material=material, name=name, **shape))
        return self
