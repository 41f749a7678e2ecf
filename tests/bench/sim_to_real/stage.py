# SPDX-License-Identifier: Apache-2.0
"""Takes the depth of a round of views in one of our worlds. Each object has an environment of its own, and one render
and one match serve all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from sim_to_real.objects import BenchmarkObject
from sim_to_real.views import View
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import CAMERA_TO_BODY
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.sensor.depth_modes import DepthCamera
from activestereo.sensor.mounts import Mounts

_NEAREST_M, _FARTHEST_M = 0.3, 1.5
_TABLE_HALF_M = 1.0


@dataclass(frozen=True)
class CameraSettings:
    """sensor: a preset's name or a camera's .toml file. Its images are made `scale` times as large, then cut to size_px
    (width, height) about the middle; the depth's camera is the same. samples: rays per pixel."""

    sensor: str = "d435"
    scale: float = 0.6
    size_px: tuple[int, int] = (160, 120)
    samples: int = 16


@dataclass(frozen=True)
class Room:
    """The room around the objects. ambient: radiance; lamp: its place, metres, and power, W/sr."""

    ambient: float = 0.2
    table_albedo: float = 0.5
    lamp_m: tuple[float, float, float] = (0.4, 0.3, 1.2)
    lamp_w_per_sr: float = 1.0


class Stage:
    """depth [objects, height, width] metres of rounds of views, in any order. One thread at a time."""

    def __init__(
        self,
        objects: tuple[BenchmarkObject, ...],
        world: str,
        settings: CameraSettings,
        device: str | int = "auto",
        room: Room = Room(),
    ) -> None:
        self._objects = objects
        self.scene = kuafu.Scene(kuafu.Device(device))
        _furnish(self.scene, room)
        self.bodies = Bodies(self.scene, len(objects))
        self.materials = [self.scene.add_material(thing.material) for thing in objects]
        for index, thing in enumerate(objects):
            shape = Shape(add_mesh(self.scene, thing.mesh, thing.name), [self.materials[index]])
            self.bodies.add(thing.name, {index: [shape]})
        self.mounts = Mounts(self.scene, np.broadcast_to(np.eye(4), (len(objects), 4, 4)))
        self.config = crop(settings)
        self.camera: Any = DepthCamera("full" if world == "foreign" else world, self.config, self.mounts)

    def take_depth(self, views: list[View], seed: int) -> NDArray[np.float32]:
        """0 = no measurement. Everything drawn at random depends on `seed` alone."""
        self.bodies.move({self._objects[v.object_index].name: self._in_all(v.object_to_world) for v in views})
        self.mounts.poses = np.stack([v.camera_to_world @ CAMERA_TO_BODY.T for v in views])
        self.camera.seed(seed)
        return np.asarray(self.camera.take_depth(), np.float32)

    def _in_all(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.broadcast_to(pose, (len(self._objects), 4, 4))


def crop(settings: CameraSettings) -> StereoDepthSensorConfig:
    """The sensor's configuration for the middle of its infrared images; depth is seen from the RGB camera's place with
    the same K and size, without distortion. Raises ValueError if the sensor's images are smaller."""
    config = StereoDepthSensorConfig(settings.sensor).scaled(settings.scale)
    width, height = settings.size_px
    if width > config.ir_resolution[0] or height > config.ir_resolution[1]:
        size = "{}x{}".format(*config.ir_resolution)
        raise ValueError(f"{settings.sensor} has infrared images of {size}; {width}x{height} cannot be cut from them")
    k = np.array(config.ir_intrinsic, np.float64)
    k[:2, 2] = 0.5 * (width - 1), 0.5 * (height - 1)
    config.ir_resolution = config.rgb_resolution = (width, height)
    config.ir_intrinsic, config.rgb_intrinsic = k, k.copy()
    config.rgb_distortion = (0.0,) * 5
    config.min_depth_m, config.max_depth_m = _NEAREST_M, _FARTHEST_M
    config.max_disparity = int(np.ceil(config.focal_baseline_px_m / _NEAREST_M))
    config.samples_per_pixel = settings.samples
    if config.ir_exposure_mode == "converging":
        config.ir_exposure_mode = "settled"
    return config


def _furnish(scene: kuafu.Scene, room: Room) -> None:
    grey = (room.table_albedo,) * 3
    paint = kuafu.Material(
        name="table", base_color=(*grey, 1.0), metallic=0.0, roughness=1.0, specular=0.0, ir_albedo=room.table_albedo
    )
    slab = np.diag([_TABLE_HALF_M, _TABLE_HALF_M, 0.02, 1.0])
    slab[2, 3] = -0.02
    scene.add_instance(add_mesh(scene, solids.box()), [scene.add_material(paint)], local_to_world=slab, name="table")
    scene.set_environment((room.ambient,) * 3)
    lamp = np.eye(4)
    lamp[:3, 3] = room.lamp_m
    scene.add_light(kuafu.Light(kind="point", intensity=(room.lamp_w_per_sr,) * 3, light_to_world=lamp))
