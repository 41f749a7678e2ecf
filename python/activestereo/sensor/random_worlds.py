# SPDX-License-Identifier: Apache-2.0
"""Randomises a batch's worlds from declared ranges under a seed (domain randomisation). Bodies are drawn once; each
draw() sets new lamps, materials and sensor settings in each environment.

    ranges = WorldRanges(lamps=(1, 2), laser_power=(0.7, 1.0))
    has = drawn_bodies(ranges, environments, len(meshes), seed)  # [E, bodies]: bodies.add(..., environments=...)
    worlds = RandomWorlds(bodies, batch, ranges, seed)
    worlds.draw()  # before an episode

Light from all sides (kuafu.Scene.set_environment) is not drawn: all environments share it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import kuafu
from activestereo.common.declared_ranges import DeclaredRanges
from activestereo.scene_io.bodies import Bodies
from activestereo.sensor.batch import StereoDepthSensorBatch


@dataclass(frozen=True)
class WorldRanges(DeclaredRanges):
    """Ranges (low, high), from which each environment's values are drawn uniformly and independently. The defaults
    change only lamps. A material that lets light through keeps its roughness."""

    bodies: tuple[float, float] = (1, 1_000_000)  # count out of the bodies
    lamps: tuple[float, float] = (1, 3)  # count
    lamp_w_per_sr: tuple[float, float] = (0.5, 3.0)
    lamp_distance_m: tuple[float, float] = (1.0, 2.0)  # from the origin
    lamp_elevation_deg: tuple[float, float] = (30.0, 90.0)  # above the plane z = 0
    albedo_factor: tuple[float, float] = (1.0, 1.0)  # on base colour and infrared albedo, which stay below 1
    roughness_factor: tuple[float, float] = (1.0, 1.0)
    laser_power: tuple[float, float] = (1.0, 1.0)  # factor on the configuration's
    exposure: tuple[float, float] = (1.0, 1.0)  # factor on the configured exposure
    right_eye_turn_deg: tuple[float, float] = (0.0, 0.0)  # about each axis: a rig that has moved since its calibration

    LIMITS: ClassVar[dict[str, tuple[float, float]]] = {
        "lamp_elevation_deg": (-90.0, 90.0),
        "right_eye_turn_deg": (-5.0, 5.0),
        "lamps": (0.0, 1000.0),
    }


def drawn_bodies(ranges: WorldRanges, environments: int, bodies: int, seed: int) -> NDArray[np.bool_]:
    """Draws which bodies each environment contains, a mask [E, bodies]. bodies: their number; seed: repeats the
    draw."""
    random = np.random.default_rng([seed, 0])
    low, high = (min(int(bound), bodies) for bound in ranges.bodies)
    has = np.zeros((environments, bodies), bool)
    for row in has:
        row[random.permutation(bodies)[: int(random.integers(low, high + 1))]] = True
    return has


class RandomWorlds:
    """Draws lamps, materials and sensor settings of a batch's environments. It owns the lamps until close(); each
    environment has its own copies of the bodies' materials."""

    def __init__(self, bodies: Bodies, batch: StereoDepthSensorBatch, ranges: WorldRanges, seed: int = 0) -> None:
        if bodies.environment_count is None or bodies.environment_count < batch.shape[0]:
            have = bodies.environment_count or "no"
            raise ValueError(f"the batch is of {batch.shape[0]} environments, the bodies of {have}")
        self._bodies, self._batch, self._scene, self._ranges = bodies, batch, bodies.scene, ranges
        self._count = bodies.environment_count
        self._seed, self._draws = seed, 0
        self._base: dict[int, kuafu.Material] = {}  # {material's number: the body's own material}
        self._own: dict[tuple[int, int], int] = {}  # {(environment, that number): number of its copy}
        bodies.set_materials(self._own_material)
        self._lamps = [
            [self._scene.add_light(_lamp(environment, 0.0, np.zeros(3))) for _ in range(int(ranges.lamps[1]))]
            for environment in range(self._count)
        ]

    def draw(self, environments: Iterable[int] | None = None) -> None:
        """Draws new values for these environments (None: all). The draw for one environment does not depend on which
        others are chosen."""
        chosen = set(range(self._count) if environments is None else environments)
        if any(not 0 <= environment < self._count for environment in chosen):
            raise ValueError(f"environments are 0 to {self._count - 1}, not {sorted(chosen)}")
        ranges, numbers = self._ranges, list[int]()
        lamps: list[kuafu.Light] = []
        self._draws += 1
        for environment in sorted(chosen):
            random = np.random.default_rng([self._seed, self._draws, environment])
            # 1. The lamps.
            numbers += self._lamps[environment]
            count = ranges.count("lamps", random)
            for number in range(len(self._lamps[environment])):
                azimuth = random.uniform(0.0, 2.0 * np.pi)
                elevation = np.deg2rad(ranges.draw("lamp_elevation_deg", random))
                flat = np.cos(elevation)
                way = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
                place, power = ranges.draw("lamp_distance_m", random) * way, ranges.draw("lamp_w_per_sr", random)
                lamps.append(_lamp(environment, power if number < count else 0.0, place))
            # 2. The bodies' materials.
            for (own, number), copy in self._own.items():
                if own != environment:
                    continue
                base, material = self._base[number], self._scene.get_material(copy)
                albedo, roughness = (ranges.draw(name, random) for name in ("albedo_factor", "roughness_factor"))
                red, green, blue = (min(albedo * channel, 1.0) for channel in base.base_color[:3])
                material.base_color = (red, green, blue, base.base_color[3])
                if base.ir_albedo is not None:
                    material.ir_albedo = min(albedo * base.ir_albedo, 1.0)
                if base.transmission == 0.0:
                    material.roughness = min(roughness * base.roughness, 1.0)
                self._scene.set_material(copy, material)
            # 3. The sensors: laser power [S], exposure [S], and the right cameras' turns [S, 3, 3].
            if environment < self._batch.shape[0]:
                sensors = int(np.prod(self._batch.shape[1:]))
                laser, exposure = (
                    np.array([ranges.draw(name, random) for _ in range(sensors)])
                    for name in ("laser_power", "exposure")
                )
                low, high = np.deg2rad(ranges.right_eye_turn_deg)
                turns = Rotation.from_rotvec(random.uniform(low, high, (sensors, 3))).as_matrix()
                self._batch.vary(environment, laser, exposure, turns)
        if numbers:
            self._scene.set_lights(numbers, lamps)

    def close(self) -> None:
        """Removes the lamps and the copies of materials from the scene; the bodies get their first materials back."""
        for lamp in (lamp for own in self._lamps for lamp in own):
            self._scene.remove_light(lamp)
        self._lamps = [[] for _ in self._lamps]
        self._bodies.set_materials(lambda environment, number: number)
        for material in self._own.values():
            self._scene.remove_material(material)
        self._own = {}

    def _own_material(self, environment: int, number: int) -> int:
        if number not in self._base:
            self._base[number] = self._scene.get_material(number)
        if (environment, number) not in self._own:
            self._own[environment, number] = self._scene.add_material(self._base[number])
        return self._own[environment, number]


def _lamp(environment: int, power: float, place: NDArray[np.float64]) -> kuafu.Light:
    to_world = np.eye(4)
    to_world[:3, 3] = place
    return kuafu.Light(kind="point", intensity=(power, power, power), light_to_world=to_world, environment=environment)
