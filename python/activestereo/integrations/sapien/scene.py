# SPDX-License-Identifier: Apache-2.0
"""Mirrors a live SAPIEN scene in a kuafu scene: its visible entities and lights, at their present poses.

ActorBuilder replaces SAPIEN's on machines without a rendering device, where SAPIEN refuses to make a material or a
visual shape. It has the same methods, with a kuafu.Material or a colour for materials. The visual shapes are stored as
VisualRecords, a component of the entity. SAPIEN's cylinders and capsules lie along x, its planes face along x. kuafu's
meshes get the names of SAPIEN's classes."""

from __future__ import annotations

import inspect
import weakref
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import sapien
from numpy.typing import ArrayLike, NDArray
from sapien.wrapper.actor_builder import ActorBuilder as SapienActorBuilder
from sapien.wrapper.actor_builder import VisualShapeRecord

import kuafu
from activestereo.common.optional import imported
from activestereo.common.pose import as_matrix, camera_to_world
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape
from activestereo.scene_io.meshes import Mesh


class VisualRecords(sapien.Component):
    """A component that stores an entity's visual shapes: SAPIEN's VisualShapeRecords with kuafu's materials."""

    def __init__(self, records: Sequence[VisualShapeRecord]) -> None:
        super().__init__()
        self.records = list(records)

    def on_add_to_scene(self, scene: sapien.Scene) -> None:
        """Does nothing; SAPIEN requires the method."""

    def on_remove_from_scene(self, scene: sapien.Scene) -> None:
        """Does nothing; SAPIEN requires the method."""


# Fields of SAPIEN's records whose arguments have another name.
_FIELDS = {"half_size": "scale", "half_length": "length"}


def _recording(kind: str, method: str = "add_{}_visual") -> Any:
    """Returns a method that adds a record of this kind of shape, with the arguments of SAPIEN's own method."""
    signature = inspect.signature(getattr(SapienActorBuilder, method.format(kind)))

    def add(self: ActorBuilder, *args: Any, **named: Any) -> ActorBuilder:
        bound = signature.bind(self, *args, **named)
        bound.apply_defaults()
        given = {_FIELDS.get(name, name): value for name, value in bound.arguments.items() if name != "self"}
        given["pose"] = sapien.Pose() if given["pose"] is None else given["pose"]
        material = given["material"]
        if material is not None and not isinstance(material, kuafu.Material):
            given["material"] = kuafu.Material(base_color=(*(float(v) for v in material), 1.0)[:4])
        self.visual_records.append(VisualShapeRecord(kind, **given))
        return self

    return add


class ActorBuilder(SapienActorBuilder):
    """Builds entities without SAPIEN's renderer; use ActorBuilder(scene) in place of scene.create_actor_builder()."""

    def __init__(self, scene: sapien.Scene) -> None:
        super().__init__()
        self.set_scene(scene)

    add_box_visual, add_sphere_visual = _recording("box"), _recording("sphere")
    add_capsule_visual, add_cylinder_visual = _recording("capsule"), _recording("cylinder")
    add_plane_visual, add_visual_from_file = _recording("plane"), _recording("file", "add_visual_from_file")

    def build_entity(self) -> sapien.Entity:
        entity = sapien.Entity()
        entity.add_component(VisualRecords(self.visual_records))
        entity.add_component(self.build_physx_component())
        entity.name = self.name
        return entity


# SAPIEN's specular s gives a reflectance of 0.08 s at normal incidence; glTF's scales the 0.04 of an index of 1.5.
_SPECULAR = 0.08 / 0.04


class Looks:
    """Adds entities' shapes and materials to a kuafu scene. Equal materials and textures are added once."""

    def __init__(self, scene: kuafu.Scene) -> None:
        self._scene = scene
        self._materials: dict[Any, int] = {}
        self._textures: dict[int, tuple[int, Any]] = {}

    def shapes(self, entity: Any, name: str) -> list[Shape]:
        """Adds the entity's meshes under this name and returns its shapes."""
        out = []
        for (arrays, scale, material), pose in parts(entity):
            mesh = self._scene.add_mesh(name=name, **arrays)
            to_body = as_matrix(pose) @ np.diag([*np.asarray(scale, np.float64), 1.0])
            out.append(Shape(mesh, [self.material(material)], to_body))
        return out

    def material(self, material: Any) -> int:
        if isinstance(material, kuafu.Material):
            return self._scene.add_material(material)
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
                if id(texture) not in self._textures:
                    number = self._scene.add_texture(np.ascontiguousarray(texture.download()), srgb=texture.is_srgb)
                    self._textures[id(texture)] = number, texture  # the texture itself, so that its id stays its own
                fields["base_color_texture"] = self._textures[id(texture)][0]
            self._materials[key] = self._scene.add_material(kuafu.Material(**fields))
        return self._materials[key]


def is_visible(entity: Any) -> bool:
    """Returns whether SAPIEN shows one of the entity's render bodies. An entity without render bodies counts as visible
    if it has VisualRecords or collision shapes."""
    bodies = _components(entity, "RenderBodyComponent")
    if bodies:
        return any(body.visibility > 0 for body in bodies)
    return any(isinstance(c, VisualRecords) or hasattr(c, "collision_shapes") for c in entity.components)


def parts(entity: Any) -> Iterator[tuple[Part, Any]]:
    """Yields (part, sapien.Pose of its shape in the entity) for an entity's visual shapes, or for its collision shapes
    if it has no visual ones."""
    shapes: list[tuple[Any, Any, Callable[[Any], Iterator[Part]]]]
    bodies = _components(entity, "RenderBodyComponent")
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


def light_record(light: Any, environment: int | None = None) -> kuafu.Light | None:
    """Converts a SAPIEN light to kuafu's. Returns None for a projector, which a sensor makes, and for kinds that kuafu
    lacks."""
    fields = {
        "intensity": tuple(light.color),
        "light_to_world": camera_to_world(light.entity.pose * light.local_pose),
        "environment": environment,
    }
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


def own_matrix(k: NDArray[np.float64]) -> NDArray[np.float64]:
    """Converts K [3, 3] from SAPIEN's pixel centres at halves to ours at integers."""
    k = np.array(k, np.float64)
    k[:2, 2] -= 0.5
    return k


def render_system(scene: Any) -> Any:
    """Returns the scene's render system; None if SAPIEN has no renderer."""
    try:
        return scene.render_system
    except RuntimeError:  # SAPIEN's error without a renderer
        return None


def _components(entity: Any, kind: str) -> list[Any]:
    return [c for c in entity.components if type(c).__name__ == kind]


# Half the side, in metres, of a collision plane, which is infinite in SAPIEN.
_ENDLESS_M = 50.0
_GREY = (0.6, 0.6, 0.6, 1.0)


class Part(NamedTuple):
    """A mesh with one material, in the frame of the visual shape that it is from. arrays: arguments of kuafu's
    add_mesh(), without normals or uvs if the source has none. scale: [3], factors not yet applied to positions."""

    arrays: dict[str, NDArray[Any]]
    scale: ArrayLike
    material: Any  # kuafu.Material, SAPIEN's RenderMaterial, or None


def render_parts(shape: Any) -> Iterator[Part]:
    """Yields each mesh of a SAPIEN RenderShape as a Part. Box, sphere, cylinder and plane have unit size and a scale,
    capsules their own size."""
    kind = type(shape).__name__
    if kind == "RenderShapeBox":
        scale = shape.half_size
    elif kind == "RenderShapeSphere":
        scale = [shape.radius] * 3
    elif kind == "RenderShapeCylinder":
        scale = [shape.half_length, shape.radius, shape.radius]
    elif kind in ("RenderShapePlane", "RenderShapeTriangleMesh"):
        scale = shape.scale
    else:
        scale = [1.0, 1.0, 1.0]
    for part in shape.parts:
        arrays, optional = _arrays(part), {"normals": part.get_vertex_normal(), "uvs": part.get_vertex_uv()}
        told = {name: _floats(own) for name, own in optional.items() if len(own) == len(arrays["positions"])}
        yield Part(arrays | told, scale, part.material)


def record_parts(record: Any) -> Iterator[Part]:
    """Yields the part of a VisualShapeRecord; reads mesh files with trimesh. Raises ImportError without it, and
    ValueError for an unreadable file."""
    material = record.material or kuafu.Material(base_color=_GREY)
    if record.type == "file":
        text = f"{record.filename} is read by the package trimesh, which is missing: pip install trimesh"
        trimesh = imported("trimesh", text)
        try:
            loaded = trimesh.load(record.filename, force="mesh", process=False)
        except Exception as error:  # errors of trimesh's many readers
            raise ValueError(f"{record.filename}: no mesh could be read: {error}") from error
        faces, normals = np.ascontiguousarray(loaded.faces, np.uint32), _floats(loaded.vertex_normals)
        arrays = {"positions": _floats(loaded.vertices), "indices": faces, "normals": normals}
        yield Part(arrays, record.scale, material)
        return
    mesh, scale = _solid(record.type, record.scale, record.radius, record.length)
    yield Part(vars(mesh), scale, material)


def collision_parts(shape: Any) -> Iterator[Part]:
    """Yields the part of a PhysxCollisionShape, in grey, for an entity without visual shapes."""
    kind = type(shape).__name__.removeprefix("PhysxCollisionShape")
    grey = kuafu.Material(name="collision shape", base_color=_GREY)
    if kind in ("ConvexMesh", "TriangleMesh"):
        yield Part(_arrays(shape), shape.scale, grey)
        return
    size = getattr(shape, "half_size", [_ENDLESS_M] * 3)
    mesh, scale = _solid(kind.lower(), size, getattr(shape, "radius", 1.0), getattr(shape, "half_length", 1.0))
    yield Part(vars(mesh), scale, grey)


def _solid(kind: str, size: ArrayLike, radius: float, half_length: float) -> tuple[Mesh, ArrayLike]:
    if kind == "box":
        return solids.box(), size
    if kind == "sphere":
        return solids.sphere(), [radius] * 3
    if kind == "cylinder":
        return solids.turned(solids.cylinder(), solids.Z_TO_X), [half_length, radius, radius]
    if kind == "capsule":
        return solids.turned(solids.capsule(float(radius), float(half_length)), solids.Z_TO_X), [1.0, 1.0, 1.0]
    if kind == "plane":
        return solids.turned(solids.rectangle(), solids.Z_TO_X), size
    raise ValueError(f"SAPIEN's shape '{kind}' has no likeness in a kuafu scene")


def _arrays(shape: Any) -> dict[str, NDArray[Any]]:
    return {"positions": _floats(shape.vertices), "indices": np.ascontiguousarray(shape.triangles, np.uint32)}


def _floats(values: ArrayLike) -> NDArray[np.float32]:
    return np.ascontiguousarray(values, np.float32)


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
        self.update()
        SapienScene._known[id(scene)] = self

    @classmethod
    def for_scene(cls, scene: sapien.Scene) -> SapienScene:
        """Returns the mirror of a SAPIEN scene; makes one at the first call."""
        known = cls._known.get(id(scene))
        return cls(scene) if known is None or known.sapien_scene is not scene else known

    def update(self) -> int:
        """Updates the mirror to SAPIEN's present state. Returns the number of shapes that moved."""
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
