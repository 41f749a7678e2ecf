# SPDX-License-Identifier: Apache-2.0
"""Shows any simulator's rigid bodies in a kuafu scene: each body is added once, then moved by arrays of poses.

    bodies = Bodies(scene, environment_count=16)
    cup = bodies.add("cup", [Shape(scene.add_mesh(positions, triangles), [material])])
    bodies.move(poses)  # [16, bodies, 7] or [16, bodies, 4, 4]: NumPy, torch, or anything with DLPack

activestereo.integrations.mujoco and activestereo.integrations.sapien use it to mirror their simulator's scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
from activestereo.common.pose import PosesLike, host_array, pose_fault, pose_matrices
from activestereo.common.shown import did_you_mean
from activestereo.scene_io.meshes import Mesh


class BodyPoseError(ValueError):
    """Raised if a pose is not rigid or not finite. Environments with such a pose stay as they were; the others have
    moved. environment (None for a single scene) and body: those of the first bad pose."""

    def __init__(self, text: str, environment: int | None, body: str) -> None:
        super().__init__(text)
        self.environment, self.body = environment, body


@dataclass(frozen=True)
class Shape:
    """A mesh of a body. mesh, materials: numbers in the scene. to_body: 4x4 from the mesh's to the body's frame, scale
    included."""

    mesh: int
    materials: Sequence[int] = ()
    to_body: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))


class Bodies:
    """Rigid bodies of one scene, numbered in the order of adding. environment_count: number E of environments, which
    share meshes and materials; each camera sees one. None: one scene without environments, whose poses are [bodies, 7]
    or [bodies, 4, 4]."""

    def __init__(self, scene: kuafu.Scene, environment_count: int | None = None) -> None:
        if environment_count is not None and environment_count < 1:
            raise ValueError(f"a batch has at least one environment, not {environment_count}")
        self.scene = scene
        self.environment_count = environment_count
        self.names: list[str] = []
        # One row for each instance in the scene: its number, environment, body and 4x4 to the body.
        self._instances = np.empty(0, np.uint32)
        self._environments = np.empty(0, np.intp)
        self._bodies = np.empty(0, np.intp)
        self._semantic_ids = np.zeros(1, np.uint32)
        self._to_body = np.empty((0, 4, 4))
        self._materials: list[tuple[int, ...]] = []  # each instance's, as add() got them
        self._varied: dict[tuple[int, int], int] = {}  # {(environment, original material): varied material}
        self._last = np.zeros((environment_count or 1, 0, 4, 4))

    def add(
        self,
        name: str,
        shapes: Iterable[Shape] | Mapping[int, Iterable[Shape]],
        pose: ArrayLike | None = None,
        environments: Iterable[int] | None = None,
        semantic_id: int = 0,
    ) -> int:
        """Puts a body into the scene and returns its number. shapes: the same in each environment, or {environment:
        shapes}. pose: [7] or [4, 4] until the body is moved. environments: numbers of the environments that get the
        body; None: all. semantic_id: the body's value in kuafu's output `semantic_id`."""
        if name in self.names:
            raise ValueError(f"there is a body '{name}' already")
        start = np.eye(4) if pose is None else pose_matrices(np.asarray(pose, dtype=np.float64), f"body '{name}'")
        fault = pose_fault(start)
        if start.shape != (4, 4) or fault.any():
            raise ValueError(f"body '{name}': a pose is [7] or a rigid [4, 4] of finite numbers; got {pose!r}")
        if isinstance(shapes, Mapping) and environments is not None:
            raise ValueError(f"body '{name}': its shapes name the environments already")
        chosen = shapes.keys() if isinstance(shapes, Mapping) else environments
        if self.environment_count is None:
            if chosen is not None:
                raise ValueError(f"body '{name}': this scene has no environments to choose from")
            seen_by: list[int | None] = [None]
        else:
            seen_by = list(range(self.environment_count) if chosen is None else chosen)
            if any(e is None or not 0 <= e < self.environment_count for e in seen_by):
                raise ValueError(f"body '{name}': environments are 0 to {self.environment_count - 1}, not {seen_by}")
        if isinstance(shapes, Mapping):
            rows = [(e, shape) for e, own in zip(seen_by, shapes.values(), strict=True) for shape in own]
        else:
            rows = [(e, shape) for shape in shapes for e in seen_by]
        instances = [
            self.scene.add_instance(
                shape.mesh,
                shape.materials,
                local_to_world=start @ shape.to_body,
                environment=environment,
                semantic_id=semantic_id,
                name=name,
            )
            for environment, shape in rows
        ]
        self._instances = np.append(self._instances, np.array(instances, np.uint32))
        if instances:  # their numbers are above those of all earlier instances
            more = np.zeros(instances[-1] + 2 - len(self._semantic_ids), np.uint32)
            self._semantic_ids = np.append(self._semantic_ids, more)
            self._semantic_ids[instances] = semantic_id
        where = np.array([environment or 0 for environment, _ in rows], np.intp)
        to_body = np.array([shape.to_body for _, shape in rows], np.float64).reshape(-1, 4, 4)
        self._environments = np.append(self._environments, where)
        self._bodies = np.append(self._bodies, np.full(len(rows), len(self.names), np.intp))
        self._to_body = np.concatenate([self._to_body, to_body])
        self._materials += [tuple(shape.materials) for _, shape in rows]
        self.names.append(name)
        self._last = np.concatenate([self._last, np.broadcast_to(start, (len(self._last), 1, 4, 4))], axis=1)
        return len(self.names) - 1

    def remove(self, name: str) -> None:
        """Removes a body from the scene; its meshes and materials stay. The numbers of the bodies after it fall by
        one."""
        body = self.index(name)
        stays = self._bodies != body
        for instance in self._instances[~stays].tolist():
            self.scene.remove_instance(instance)
        self._instances = self._instances[stays]
        self._materials = [own for own, stay in zip(self._materials, stays, strict=True) if stay]
        self._environments, self._to_body = self._environments[stays], self._to_body[stays]
        self._bodies = self._bodies[stays] - (self._bodies[stays] > body)
        del self.names[body]
        self._last = np.delete(self._last, body, axis=1)

    def vary_albedo(self, name: str, factors: ArrayLike) -> None:
        """Multiplies the base colours and infrared albedos that a body was added with by a factor for each environment,
        [E]. Products are at most 1. Bodies of an environment that share a material also share its last factor. Raises
        ValueError with all environments of bad factors; nothing has changed then."""
        body, values = self.index(name), np.asarray(factors, np.float64)
        if values.shape != (self.environment_count,):
            raise ValueError(f"albedo of '{name}' is {list(values.shape)}, expected [{self.environment_count}] factors")
        if bad := [f"environment {n} is {value:g}" for n, value in enumerate(values) if not 0.0 <= value < np.inf]:
            raise ValueError(f"albedo of '{name}' in {'; '.join(bad)}, expected finite factors of 0 or more")
        for row in np.flatnonzero(self._bodies == body).tolist():
            environment = int(self._environments[row])
            own, factor = [], float(values[environment])
            for number in self._materials[row]:
                material, key = self.scene.get_material(number), (environment, number)
                red, green, blue = (min(factor * channel, 1.0) for channel in material.base_color[:3])
                material.base_color = (red, green, blue, material.base_color[3])
                if material.ir_albedo is not None:
                    material.ir_albedo = min(factor * material.ir_albedo, 1.0)
                if key in self._varied:
                    self.scene.set_material(self._varied[key], material)
                else:
                    self._varied[key] = self.scene.add_material(material)
                own.append(self._varied[key])
            if own:
                self.scene.set_instance_materials(int(self._instances[row]), own)

    def index(self, name: str) -> int:
        """Returns a body's number. Raises ValueError for an unknown name."""
        if name in self.names:
            return self.names.index(name)
        raise ValueError(f"there is no body '{name}' among {len(self.names)}{did_you_mean(name, self.names)}")

    @property
    def poses(self) -> NDArray[np.float64]:
        """Returns a copy of the bodies' present poses, [E, bodies, 4, 4]; without environments [bodies, 4, 4]."""
        return self._last[0].copy() if self.environment_count is None else self._last.copy()

    @property
    def semantic_id_table(self) -> NDArray[np.uint32]:
        """Returns a copy of the semantic_id of each instance, indexed by the instance's number. The last entry is 0 and
        stands for all larger numbers."""
        return self._semantic_ids.copy()

    def move(self, poses: PosesLike | Mapping[str, PosesLike]) -> int:
        """Moves the bodies whose pose has changed. Returns the number of instances (meshes) that moved.

        poses: body to world, [E, bodies, 7] (x, y, z, then the quaternion w, x, y, z) or [E, bodies, 4, 4]; without
        environments the first axis is absent. A mapping {name: [E, 7] or [E, 4, 4]} moves some bodies. Raises
        BodyPoseError for a pose that is not rigid and finite, and ValueError for another shape or an unknown body."""
        lead, count = () if self.environment_count is None else (self.environment_count,), len(self.names)
        if isinstance(poses, Mapping):
            now = self._last.copy()
            for name, given in poses.items():
                body, array = self.index(name), host_array(given)
                if array.shape not in ((*lead, 7), (*lead, 4, 4)):
                    wanted = f"{(*lead, 7)} or {(*lead, 4, 4)}"
                    raise ValueError(f"poses of body '{name}' have the shape {wanted}, not {array.shape}")
                now[:, body] = pose_matrices(array, f"body '{name}'")
        else:
            array = host_array(poses)
            if array.shape not in ((*lead, count, 7), (*lead, count, 4, 4)):
                raise ValueError(
                    f"poses of {count} bodies"
                    + (f" in {self.environment_count} environments" if lead else "")
                    + f" have the shape {(*lead, count, 7)} or {(*lead, count, 4, 4)}, not {array.shape}"
                )
            now = pose_matrices(array, "poses").reshape(self.environment_count or 1, count, 4, 4)
        fault = pose_fault(now)
        has_moved = (now != self._last).any(axis=(2, 3))
        broken = fault.any(axis=1)
        has_moved[broken] = False
        rows = np.flatnonzero(has_moved[self._environments, self._bodies])
        to_world = now[self._environments[rows], self._bodies[rows]] @ self._to_body[rows]
        self.scene.set_instance_poses(self._instances[rows], to_world)
        now[broken] = self._last[broken]
        self._last = now
        if not broken.any():
            return int(rows.size)
        environment, body = (int(v) for v in np.argwhere(fault)[0])
        place = f"environment {environment}, body '{self.names[body]}'"
        kept = f"; {broken.sum()} of {self.environment_count} environments stay as they were, the others have moved"
        if self.environment_count is None:
            place, kept = f"body '{self.names[body]}'", "; nothing has moved"
        text = f"{place}: its pose is not a finite rigid one{kept}"
        raise BodyPoseError(text, None if self.environment_count is None else environment, self.names[body])


def add_mesh(scene: kuafu.Scene, mesh: Mesh, name: str = "") -> int:
    """Adds a mesh with its normals and texture coordinates to a scene, and returns its number."""
    return scene.add_mesh(mesh.positions, mesh.indices, normals=mesh.normals, uvs=mesh.uvs, name=name)
