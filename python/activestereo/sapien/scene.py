# SPDX-License-Identifier: Apache-2.0
"""A live SAPIEN scene as a kuafu scene: its visible entities and lights, and where they are now."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import sapien

import kuafu
from activestereo.bodies import Bodies, Shape
from activestereo.pose import as_matrix, camera_to_world
from activestereo.sapien.builder import VisualRecords
from activestereo.sapien.shapes import Part, collision_parts, record_parts, render_parts

# SAPIEN's specular s is a reflectance of 0.08 s at normal incidence; glTF's weighs the 0.04 of an index of 1.5.
_SPECULAR = 0.08 / 0.04
# Even light in a scene whose lights cannot be known, since SAPIEN has no renderer.
_AMBIENT = (0.3, 0.3, 0.3)


class SapienScene:
    """The scene's entities, each by its render components where SAPIEN has a renderer, else by the VisualRecords that
    activestereo.sapien.ActorBuilder left, else by its collision shapes in grey.

    update() follows entities that come, go, hide (visibility 0) or move. `scene` is the kuafu.Scene; lights and
    materials of one's own may be added to it. device: 'auto', 'cpu', an index or a kuafu.Device.
    """

    _known: weakref.WeakValueDictionary[int, SapienScene] = weakref.WeakValueDictionary()

    def __init__(self, scene: sapien.Scene, device: str | int | kuafu.Device = "auto") -> None:
        self.sapien_scene = scene
        self.scene = kuafu.Scene(device if isinstance(device, kuafu.Device) else kuafu.Device(device))
        self.bodies = Bodies(self.scene)
        self._names: dict[int, str] = {}  # of the entities that are in the scene, by per_scene_id
        self._materials: dict[Any, int] = {}
        self._textures: dict[int, tuple[int, Any]] = {}
        self._lights: list[tuple[Any, int]] = []
        self._ambient: tuple[float, ...] = _AMBIENT
        self.scene.set_environment(_AMBIENT)
        self.update()
        SapienScene._known[id(scene)] = self

    @classmethod
    def of(cls, scene: sapien.Scene) -> SapienScene:
        """The one that a SAPIEN scene has already, else a new one."""
        known = cls._known.get(id(scene))
        return cls(scene) if known is None or known.sapien_scene is not scene else known

    def update(self) -> int:
        """Brings the scene up to date; returns how many shapes moved."""
        seen = {entity.per_scene_id: entity for entity in self.sapien_scene.entities if _is_visible(entity)}
        for number in [n for n in self._names if n not in seen]:
            self.bodies.remove(self._names.pop(number))
        for number in [n for n in seen if n not in self._names]:
            self._add(seen[number])
        self._follow_lights()
        # Bodies and names are in one order: both lose and gain at the same places.
        poses = [seen[number].pose.to_transformation_matrix() for number in self._names]
        return self.bodies.move(np.array(poses, np.float64).reshape(-1, 4, 4))

    def _add(self, entity: Any) -> None:
        name = entity.name or "entity"
        if name in self.bodies.names:
            name = f"{name} ({entity.per_scene_id})"
        shapes = [self._shape(part, pose, name) for part, pose in _parts(entity)]
        pose = as_matrix(entity.pose)
        self.bodies.add(name, shapes, pose=pose, semantic_id=entity.per_scene_id)
        self._names[entity.per_scene_id] = name

    def _shape(self, part: Part, pose: Any, name: str) -> Shape:
        optional = {"normals": part.normals, "uvs": part.uvs}
        given = {key: value for key, value in optional.items() if value is not None}
        mesh = self.scene.add_mesh(part.positions, part.indices, name=name, **given)
        to_body = as_matrix(pose) @ np.diag([*np.asarray(part.scale, np.float64), 1.0])
        return Shape(mesh, [self._material(part.material)], to_body)

    def _material(self, material: Any) -> int:
        if isinstance(material, kuafu.Material):
            return self.scene.add_material(material)
        texture = material.base_color_texture
        values = [*material.base_color, *material.emission, material.metallic, material.roughness]
        values += [material.specular, material.transmission, material.ior]
        key = (*values, None if texture is None else id(texture))
        if key not in self._materials:
            fields = {
                "base_color": tuple(material.base_color),
                "emission": tuple(material.emission[:3]),
                "metallic": material.metallic,
                "roughness": material.roughness,
                "transmission": material.transmission,
            }
            if material.transmission > 0:
                fields["ior"] = material.ior
            else:
                fields["specular"] = min(_SPECULAR * material.specular, 1.0)
            if texture is not None:
                fields["base_color_texture"] = self._texture(texture)
            self._materials[key] = self.scene.add_material(kuafu.Material(**fields))
        return self._materials[key]

    def _texture(self, texture: Any) -> int:
        if id(texture) not in self._textures:
            texels = np.ascontiguousarray(texture.download())
            # With the texture itself, so that its id stays its own.
            self._textures[id(texture)] = (self.scene.add_texture(texels, srgb=texture.is_srgb), texture)
        return self._textures[id(texture)][0]

    def _follow_lights(self) -> None:
        system = _render_system(self.sapien_scene)
        if system is None:
            return
        if self._ambient != (ambient := tuple(system.ambient_light)):
            self.scene.set_environment(ambient)
            self._ambient = ambient
        records = [(light, record) for light in system.lights if (record := _light(light)) is not None]
        if [light for light, _ in self._lights] != [light for light, _ in records]:
            for _, number in self._lights:
                self.scene.remove_light(number)
            self._lights = [(light, self.scene.add_light(record)) for light, record in records]
            return
        for (_, number), (_, record) in zip(self._lights, records, strict=True):
            before = self.scene.get_light(number)
            if before.intensity != record.intensity or not np.array_equal(before.light_to_world, record.light_to_world):
                self.scene.set_light(number, record)


def _render_system(scene: sapien.Scene) -> Any:
    try:
        return scene.render_system
    except RuntimeError:  # SAPIEN's way to say that there is none
        return None


def _of_kind(entity: Any, kind: str) -> list[Any]:
    return [c for c in entity.components if type(c).__name__ == kind]


def _is_visible(entity: Any) -> bool:
    bodies = _of_kind(entity, "RenderBodyComponent")
    if bodies:
        return any(body.visibility > 0 for body in bodies)
    return any(isinstance(c, VisualRecords) or hasattr(c, "collision_shapes") for c in entity.components)


def _parts(entity: Any) -> Iterator[tuple[Part, Any]]:
    """What the entity looks like, each with the shape's pose in the entity."""
    shapes: list[tuple[Any, Any, Callable[[Any], Iterator[Part]]]]
    bodies = _of_kind(entity, "RenderBodyComponent")
    records = [r for c in entity.components if isinstance(c, VisualRecords) for r in c.records]
    if bodies:
        shapes = [(shape, shape.local_pose, render_parts) for body in bodies for shape in body.render_shapes]
    elif any(isinstance(c, VisualRecords) for c in entity.components):
        shapes = [(record, record.pose, record_parts) for record in records]
    else:
        solid = [s for c in entity.components for s in getattr(c, "collision_shapes", [])]
        shapes = [(shape, shape.local_pose, collision_parts) for shape in solid]
    for shape, pose, parts_of in shapes:
        for part in parts_of(shape):
            yield part, pose


def _light(light: Any) -> kuafu.Light | None:
    """None for a projector, which is a sensor's to make, and for kinds that kuafu lacks."""
    fields = {"intensity": tuple(light.color), "light_to_world": camera_to_world(light.entity.pose * light.local_pose)}
    kind = type(light).__name__
    if kind == "RenderDirectionalLightComponent":
        return kuafu.Light(kind="directional", **fields)
    if kind == "RenderPointLightComponent":
        return kuafu.Light(kind="point", **fields)
    if kind == "RenderSpotLightComponent":
        return kuafu.Light(kind="spot", inner_rad=light.inner_fov / 2, outer_rad=light.outer_fov / 2, **fields)
    if kind == "RenderParallelogramLightComponent":
        return kuafu.Light(kind="rectangle", size_m=(2 * light.half_width, 2 * light.half_height), **fields)
    return None
