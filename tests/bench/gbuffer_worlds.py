# SPDX-License-Identifier: Apache-2.0
"""Random tables of matt, glossy and metal things that a path-traced sensor and one on G-buffers see alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo import StereoDepthSensor
from activestereo.common.pose import Pose, body_pose, look_at
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh

KINDS = ("matt", "gloss", "metal")
THINGS = 9  # that there are; each world has some
LEAST_THINGS, ALBEDO_FACTOR, ROUGHNESS_FACTOR = 5, (0.4, 1.3), (0.6, 1.4)
_SIZE_M, _PLACE_M, _ROOM = (0.04, 0.09), 0.3, (0.0, 0.1)  # half lengths; W/(sr m^2) from all sides
_NOTHING = 0xFFFFFFFF
_MATT = {"specular": 0.0, "roughness": 1.0}


@dataclass(frozen=True)
class World:
    """A table, a wall and things upon it, seen from pose. kinds: of each material's number, an index into KINDS."""

    scene: kuafu.Scene
    bodies: Bodies
    pose: Pose
    kinds: dict[int, int]
    room_w_per_sr_m2: float

    @classmethod
    def draw(cls, seed: int, device: str | int = "cpu") -> World:
        random = np.random.default_rng([seed, 7])
        scene, kinds = kuafu.Scene(kuafu.Device(device)), {}
        room = float(random.uniform(*_ROOM))
        scene.set_environment((room, room, room))
        bodies, meshes = Bodies(scene, 1), [add_mesh(scene, s()) for s in (solids.box, solids.sphere, solids.cylinder)]

        def put(name: str, mesh: int, half_m: Any, place: Any, looks: dict[str, Any], gray: float) -> None:
            material = scene.add_material(kuafu.Material(base_color=(gray, gray, gray, 1.0), **looks))
            bodies.add(name, [Shape(mesh, [material], np.diag([*half_m, 1.0]))], pose=place)

        put("table", meshes[0], (1, 1, 0.02), (0, 0, -0.02, 1, 0, 0, 0), _MATT, random.uniform(0.2, 0.6))
        put("wall", meshes[0], (0.02, 1.5, 1), (0.7, 0, 0.5, 1, 0, 0, 0), _MATT, random.uniform(0.3, 0.7))
        chosen = np.random.default_rng([seed, 0])
        order = chosen.permutation(THINGS)
        for n in np.sort(order[: int(chosen.integers(LEAST_THINGS, THINGS + 1))]).tolist():
            kind, half = KINDS[n % len(KINDS)], random.uniform(*_SIZE_M, 3)
            mesh, turn = int(random.integers(3)), random.uniform(0.0, np.pi)
            place = (*random.uniform(-_PLACE_M, _PLACE_M, 2), half[2], np.cos(turn / 2), 0, 0, np.sin(turn / 2))
            looks = {
                "matt": _MATT,
                "gloss": {"roughness": random.uniform(0.15, 0.5)},
                "metal": {"metallic": 1.0, "roughness": random.uniform(0.2, 0.5)},
            }[kind]
            put(f"{kind} {n}", meshes[mesh], half, place, looks, random.uniform(0.15, 0.75))
        eye = (-random.uniform(0.5, 0.9), random.uniform(-0.3, 0.3), random.uniform(0.35, 0.8))
        pose = body_pose(look_at(eye, (0.0, 0.0, 0.05), (0, 0, 1)))
        factors = np.random.default_rng([seed, 1, 0])
        for number in range(scene.summary.material_count):
            material = scene.get_material(number)
            albedo, roughness = (factors.uniform(*ends) for ends in (ALBEDO_FACTOR, ROUGHNESS_FACTOR))
            red, green, blue = (min(albedo * channel, 1.0) for channel in material.base_color[:3])
            material.base_color, material.roughness = (red, green, blue, 1.0), min(roughness * material.roughness, 1.0)
            scene.set_material(number, material)
            kinds[number] = _kind(material)
        return cls(scene, bodies, pose, kinds, room)

    def materials(self) -> dict[int, kuafu.Material]:
        return {number: self.scene.get_material(number) for number in self.kinds}

    def gbuffers(self, sensor: StereoDepthSensor, side: str = "left") -> dict[str, NDArray[Any]]:
        """Depth, normals and materials, as a renderer of one's own gives them of this infrared camera."""
        images = {name: sensor.get_picture(name, side) for name in ("depth", "normal", "material_id")}
        to_camera = np.linalg.inv(np.array(sensor.ir_cameras()[side == "right"].camera_to_world))[:3, :3]
        number = images["material_id"][..., 0].astype(np.int64)
        is_nothing = number == _NOTHING
        return {
            "depth": np.where(is_nothing, np.float32(0.0), images["depth"][..., 0]),
            "normal": images["normal"] @ to_camera.T.astype(np.float32),
            "material": np.where(is_nothing, 0, number),
        }

    def kind_of(self, given: dict[str, NDArray[Any]]) -> NDArray[np.intp]:
        """[height, width]: an index into KINDS, -1 where nothing is."""
        table = np.array([self.kinds[number] for number in sorted(self.kinds)])
        return np.where(given["depth"] > 0, table[given["material"]], -1)


def _kind(material: kuafu.Material) -> int:
    if material.metallic > 0.5:
        return KINDS.index("metal")
    return KINDS.index("gloss" if material.specular > 0.0 else "matt")
