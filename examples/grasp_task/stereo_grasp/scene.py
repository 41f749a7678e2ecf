# SPDX-License-Identifier: Apache-2.0
"""The objects on the table of each environment: boxes and cylinders of several materials, of which one at a time is on
the table and the others wait below it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh

OBJECTS = 4  # in each environment
_BELOW_M = -3.0
_TABLE_HALF_M = 0.6


class GraspScene:
    """half_sizes_m: [E, OBJECTS, 3]; a cylinder's first two are its radius. is_round: [OBJECTS]."""

    def __init__(
        self,
        environment_count: int,
        random: np.random.Generator,
        device: str | int | kuafu.Device,
        things: str = "mixed",
    ) -> None:
        if things not in _MATERIALS:
            raise ValueError(f"things are {' or '.join(map(repr, _MATERIALS))}, not {things!r}")
        self.scene = kuafu.Scene(device if isinstance(device, kuafu.Device) else kuafu.Device(device))
        self.bodies = Bodies(self.scene, environment_count)
        self.is_round = np.arange(OBJECTS) % 2 == 1
        shape = (environment_count, OBJECTS)
        sizes = np.stack([random.uniform(low, high, shape) for low, high in _SIZES_M], axis=-1)
        sizes[:, self.is_round, 1] = sizes[:, self.is_round, 0]
        self.half_sizes_m = sizes
        numbers = [self.scene.add_material(material) for material in _MATERIALS[things]]
        self._add_room()
        meshes = add_mesh(self.scene, solids.box()), add_mesh(self.scene, solids.cylinder())
        for number in range(OBJECTS):
            own = {}  # each environment's size and material
            for environment in range(environment_count):
                scale = np.diag([*sizes[environment, number], 1.0])
                paint = numbers[int(random.integers(len(numbers)))]
                own[environment] = [Shape(meshes[int(self.is_round[number])], [paint], scale)]
            self.bodies.add(f"object {number}", own)
        self._poses = np.broadcast_to(np.eye(4), (environment_count, len(self.bodies.names), 4, 4)).copy()

    def place(self, chosen: NDArray[np.intp], at_m: NDArray[np.float64], yaw_rad: NDArray[np.float64]) -> None:
        """Puts object chosen[e] of each environment at at_m[e] (x, y) on the table, and all others below it."""
        count = len(chosen)
        self._poses[..., 2, 3] = _BELOW_M
        every = np.arange(count)
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        own = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
        own[:, 0, 0], own[:, 0, 1], own[:, 1, 0], own[:, 1, 1] = cos, -sin, sin, cos
        own[:, :2, 3], own[:, 2, 3] = at_m, self.half_sizes_m[every, chosen, 2]
        self._poses[every, chosen] = own
        self.bodies.move(self._poses)

    def _add_room(self) -> None:
        paint = self.scene.add_material(kuafu.Material(name="table", base_color=(0.5, 0.42, 0.33, 1.0), roughness=0.6))
        slab = np.diag([_TABLE_HALF_M, _TABLE_HALF_M, 0.02, 1.0])
        slab[2, 3] = -0.02
        self.scene.add_instance(add_mesh(self.scene, solids.box()), [paint], local_to_world=slab, name="table")
        self.scene.set_environment((0.25, 0.25, 0.25))
        lamp = np.diag([1.0, -1.0, -1.0, 1.0])
        lamp[:3, 3] = 0.4, 0.3, 1.2
        self.scene.add_light(kuafu.Light(kind="point", intensity=(2.0, 1.9, 1.7), light_to_world=lamp))


# Half sizes of x, y, z; the gripper opens to 0.08.
_SIZES_M = ((0.012, 0.028), (0.025, 0.05), (0.02, 0.05))


# What things are made of. Active stereo sees through hard ones, loses them or takes them for something else.
_MATERIALS = {
    "mixed": (
        kuafu.Material(name="clay", base_color=(0.7, 0.4, 0.3, 1.0), specular=0.0),
        kuafu.Material(name="plastic", base_color=(0.2, 0.4, 0.7, 1.0), roughness=0.25, ir_albedo=0.5),
        kuafu.Material(name="steel", base_color=(0.66, 0.64, 0.61, 1.0), metallic=1.0, roughness=0.25),
        kuafu.Material(name="rubber", base_color=(0.03, 0.03, 0.03, 1.0), roughness=0.5),
    ),
    "hard": (
        kuafu.Material(name="glass", transmission=1.0, roughness=0.0, ior=1.5),
        kuafu.Material(name="polished steel", base_color=(0.66, 0.64, 0.61, 1.0), metallic=1.0, roughness=0.08),
        kuafu.Material(name="black velvet", base_color=(0.01, 0.01, 0.01, 1.0), specular=0.0, ir_albedo=0.004),
    ),
}
