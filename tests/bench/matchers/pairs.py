# SPDX-License-Identifier: Apache-2.0
"""Rectified infrared pairs of things on a table, whose true disparities and materials are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

import kuafu
from activestereo.benchmarks.realism.methods import with_rgb_at_left
from sim_to_real.objects import objects
from sim_to_real.stage import CameraSettings, any_material, crop
from activestereo.common.pose import CAMERA_TO_BODY, look_at
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.mounts import Mounts

MATERIALS = ("table", *(thing.name for thing in objects()))
SIZE_PX = (320, 240)
_TABLE_HALF_M = 1.0
_SLOT_M, _JITTER_M = 0.16, 0.02  # things stand on a grid of 3 x 3, one place of which stays empty
_DISTANCE_M, _ELEVATION_DEG = (0.45, 0.8), (30.0, 65.0)
_AMBIENT, _LAMP_W_PER_SR = (0.05, 0.3), (0.3, 1.5)
_TABLE_ALBEDO, _TABLE_CONTRAST = 0.5, 0.15
_TEXTURE_PX, _OCTAVES = 1024, 6


@dataclass(frozen=True)
class Pairs:
    """left, right: uint8 [n, height, width]. truth: float32 disparities of what both cameras see, px, NaN elsewhere.
    material: the place in MATERIALS, uint8."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    truth: NDArray[np.float32]
    material: NDArray[np.uint8]


class PairStudio:
    """Takes pairs of `count` environments at a time. is_random: of materials and albedos that are drawn anew, not those
    that the things are called after. One thread at a time."""

    def __init__(
        self, count: int, is_random: bool, sensor: str = "d435", samples: int = 16, device: str | int = "auto"
    ) -> None:
        scene = kuafu.Scene(kuafu.Device(device))
        self._scene, self._count, self._is_random = scene, count, is_random
        self._bodies = Bodies(scene, count)
        self._table = scene.add_material(kuafu.Material(name="table", metallic=0.0, roughness=1.0, specular=0.0))
        self._textures = [scene.add_texture(_grain(seed), name=f"grain {seed}") for seed in range(4)]
        rectangle = add_mesh(scene, solids.rectangle(), "table")
        size = np.diag([_TABLE_HALF_M, _TABLE_HALF_M, 1.0, 1.0])
        self._bodies.add("table", [Shape(rectangle, [self._table], size)])
        self._index = {self._table: 0}
        for number, thing in enumerate(objects(), 1):
            mesh = add_mesh(scene, thing.mesh, thing.name)
            own = [scene.add_material(thing.material) for _ in range(count)]
            self._index |= dict.fromkeys(own, number)
            self._bodies.add(thing.name, {e: [Shape(mesh, [material])] for e, material in enumerate(own)})
        lamp = kuafu.Light(kind="point", intensity=(1.0, 1.0, 1.0))
        self._lamp = scene.add_light(lamp)
        self._mounts = Mounts(scene, np.broadcast_to(np.eye(4), (count, 4, 4)))
        self.config = with_rgb_at_left(crop(CameraSettings(sensor, scale=1.0, size_px=SIZE_PX, samples=samples)))
        self._sensors = StereoDepthSensorBatch(self.config, self._mounts)

    def take(self, seed: int) -> dict[str, Pairs]:
        """The same views with the projector on and off: {"on", "off"}. They depend on the seed alone."""
        random = np.random.default_rng(seed)
        self._furnish(random)
        taken: dict[str, Pairs] = {}
        for emitter, power in (("on", 1.0), ("off", 0.0)):
            self._sensors.vary(laser_power=np.full(self._count, power))
            self._sensors.restart(seed)
            self._sensors.take_picture(infrared_only=bool(taken))
            self._sensors.compute_depth()
            left, right = (np.array(image) for image in self._sensors.get_ir_measured())
            known = taken["on"] if taken else None
            truth, material = (known.truth, known.material) if known else self._truth()
            taken[emitter] = Pairs(left, right, truth, material)
        return taken

    def _truth(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        depth, material = self._sensors.get_true_depth(), self._sensors.get_material_ids()
        truth = self.config.focal_baseline_px_m / np.where(depth > 0, depth, np.nan)
        index = np.zeros(material.shape, np.uint8)
        for number, place in self._index.items():
            index[material == number] = place
        return seen_by_both(truth.astype(np.float32)), index

    def _furnish(self, random: np.random.Generator) -> None:
        scene = self._scene
        table = scene.get_material(self._table)
        table.base_color_texture = int(random.choice(self._textures))
        scene.set_material(self._table, table)
        scene.set_environment((float(random.uniform(*_AMBIENT)),) * 3)
        lamp = scene.get_light(self._lamp)
        lamp.light_to_world[:3, 3] = random.uniform([-0.6, -0.6, 0.8], [0.6, 0.6, 1.4])
        lamp.intensity = (float(random.uniform(*_LAMP_W_PER_SR)),) * 3
        scene.set_light(self._lamp, lamp)
        poses = {thing.name: np.stack([np.eye(4)] * self._count) for thing in objects()}
        mounts = np.empty((self._count, 4, 4))
        for environment in range(self._count):
            slots = random.permutation(9)
            for slot, thing in zip(slots, objects(), strict=False):
                yaw = random.uniform(0.0, 2.0 * np.pi)
                pose = poses[thing.name][environment]
                pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
                place = _SLOT_M * (np.array(divmod(int(slot), 3)) - 1.0) + random.uniform(-_JITTER_M, _JITTER_M, 2)
                pose[:3, 3] = *place, thing.rest_m
            azimuth, elevation = random.uniform(0.0, 2.0 * np.pi), np.deg2rad(random.uniform(*_ELEVATION_DEG))
            way = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
            target = np.array([*random.uniform(-0.1, 0.1, 2), 0.03])
            camera_to_world = look_at(target + random.uniform(*_DISTANCE_M) * np.array(way), target, (0.0, 0.0, 1.0))
            mounts[environment] = camera_to_world @ CAMERA_TO_BODY.T
        self._bodies.move(poses)
        self._mounts.poses = mounts
        if self._is_random:
            for number in self._index:
                if number != self._table:
                    scene.set_material(number, any_material(scene.get_material(number), random))


def seen_by_both(truth: NDArray[np.float32]) -> NDArray[np.float32]:
    """True disparities [n, height, width], NaN where the right image does not hold the point or a nearer one hides
    it."""
    n, height, width = truth.shape
    d = np.nan_to_num(truth, nan=-1.0)
    at = np.rint(np.arange(width) - d).astype(int)
    inside = (d > 0) & (at >= 0)
    nearest = np.full((n, height, width + 2), -1.0, np.float32)
    image, row, column = np.nonzero(inside)
    np.maximum.at(nearest, (image, row, at[inside] + 1), d[inside])
    around = np.maximum(nearest[..., 1:-1], np.maximum(nearest[..., 2:], nearest[..., :-2]))
    hides = np.take_along_axis(around, np.clip(at, 0, width - 1), axis=2)
    return np.where(inside & (d >= hides - 1.0), d, np.float32(np.nan)).astype(np.float32)


def _grain(seed: int) -> NDArray[np.float32]:
    """A table top's albedo, grains of 4 mm and more, each octave as strong as the others."""
    random = np.random.default_rng(seed)
    image = np.zeros((_TEXTURE_PX, _TEXTURE_PX))
    for octave in range(_OCTAVES):
        size = _TEXTURE_PX >> (octave + 1)
        image += zoom(random.standard_normal((size, size)), _TEXTURE_PX / size, order=1, mode="grid-wrap")
    image *= _TABLE_CONTRAST / image.std()
    return np.repeat(np.clip(_TABLE_ALBEDO * (1.0 + image), 0.02, 1.0)[..., None], 3, axis=2).astype(np.float32)


def joined(parts: Sequence[Pairs]) -> Pairs:
    return Pairs(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Pairs)))
