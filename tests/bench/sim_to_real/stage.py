# SPDX-License-Identifier: Apache-2.0
"""Takes the depth of a round of views in one of our worlds. Each object has an environment of its own, and one render
and one match serve all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from sim_to_real.objects import BenchmarkObject
from sim_to_real.views import View
from sim_to_real.worlds import World
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import CAMERA_TO_BODY
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.sensor.depth_modes import DepthCamera
from activestereo.sensor.mounts import Mounts

_NEAREST_M, _FARTHEST_M = 0.3, 1.5
_TABLE_HALF_M = 1.0


@dataclass(frozen=True)
class NoiseModel:
    """The noise model of an imager, as model.json has it: variance in DN^2 = offset + shot signal + relative
    signal^2."""

    offset: float
    shot: float
    relative: float = 0.0


@dataclass(frozen=True)
class CameraSettings:
    """sensor: a preset's name or a camera's .toml file. Its images are made `scale` times as large, then cut to size_px
    (width, height) about the middle; the depth's camera is the same. samples: rays per pixel. imager: in place of the
    sensor's own temporal noise."""

    sensor: str = "d435"
    scale: float = 0.6
    size_px: tuple[int, int] = (160, 120)
    samples: int = 16
    imager: NoiseModel | None = None


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
        world: World,
        settings: CameraSettings,
        device: str | int = "auto",
        room: Room = Room(),
    ) -> None:
        self._objects, self._world = objects, world
        self.scene = kuafu.Scene(kuafu.Device(device))
        _furnish(self.scene, room)
        self.bodies = Bodies(self.scene, len(objects))
        self.materials = [self.scene.add_material(thing.material) for thing in objects]
        for index, thing in enumerate(objects):
            shape = Shape(add_mesh(self.scene, thing.mesh, thing.name), [self.materials[index]])
            self.bodies.add(thing.name, {index: [shape]})
        self.mounts = Mounts(self.scene, np.broadcast_to(np.eye(4), (len(objects), 4, 4)))
        if world.samples is not None:
            settings = replace(settings, samples=world.samples)
        config = crop(settings)
        if world.is_denoised is not None:
            config.denoise = "atrous" if world.is_denoised else "none"
        if settings.imager is not None:
            set_noise(config, settings.imager)
        scale_noise(config, world.noise)
        self.config = config
        self.camera: Any = DepthCamera("full" if world.mode == "foreign" else world.mode, config, self.mounts)

    def take_depth(self, views: list[View], seed: int) -> NDArray[np.float32]:
        """0 = no measurement. Everything drawn at random depends on `seed` alone."""
        if self._world.materials == "random":
            random = np.random.default_rng(seed)
            for number in self.materials:
                self.scene.set_material(number, any_material(self.scene.get_material(number), random))
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


def set_noise(config: StereoDepthSensorConfig, noise_model: NoiseModel) -> None:
    """Sets the noise that changes from frame to frame, as the model has it; static speckle and pixels' own gains stay.
    Raises ValueError for a sensor with SAPIEN's noise."""
    if not isinstance(config.ir_signal, dict):
        raise ValueError(f"{config.model} cannot be given another noise: it has no imager of its own")
    signal = dict(config.ir_signal) | {"read_noise_e": 0.0}
    signal["adc_noise_dn"] = float(np.sqrt(max(noise_model.offset - ROUNDING_VARIANCE, 0.0)))
    if noise_model.shot > 0.0:  # a count of fewer electrons, and as many counts
        gain = signal.get("gain", 1.0) * config.ir_camera_gain
        fewer = noise_model.shot / (signal["conversion_gain_dn_per_e"] * gain)
        signal["responsivity_e"] /= fewer
        signal["conversion_gain_dn_per_e"] *= fewer
        if "full_well_e" in signal:
            signal["full_well_e"] /= fewer
    else:
        signal["shot_noise"] = 0.0
    if noise_model.relative > 0.0:
        signal |= {
            "speckle_shape": 1.0 / noise_model.relative,
            "speckle_scale": noise_model.relative,
            "speckle_correlation": 0.0,
        }
    config.ir_signal = signal


def scale_noise(config: StereoDepthSensorConfig, factor: float) -> None:
    """Standard deviations of all the imager's noise times `factor`. Raises ValueError for a sensor with SAPIEN's noise,
    where the factor is not 1."""
    if factor == 1.0:
        return
    if not isinstance(config.ir_signal, dict):
        raise ValueError(f"the noise of {config.model} cannot be scaled: it has no imager of its own")
    signal = dict(config.ir_signal)
    for name in ("adc_noise_dn", "prnu"):
        signal[name] = factor * signal.get(name, 0.0)
    if factor > 0.0:  # a count of fewer electrons has more shot noise; speckle's contrast is shape^-1/2
        signal["responsivity_e"] /= factor**2
        signal["conversion_gain_dn_per_e"] *= factor**2
        if "speckle_shape" in signal:
            signal["speckle_shape"] /= factor**2
            signal["speckle_scale"] *= factor**2
    else:
        signal["shot_noise"] = 0.0
        signal = {name: value for name, value in signal.items() if not name.startswith("speckle")}
        config.ir_speckle_of_laser = False
    config.ir_signal = signal


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


def any_material(material: kuafu.Material, random: np.random.Generator) -> kuafu.Material:
    """A random unmeasured material: any roughness and albedo, a quarter of them metal, an eighth glass."""
    kind = int(random.integers(8))
    material.metallic, material.transmission = float(kind in (1, 2)), float(kind == 0)
    material.roughness = 0.0 if kind == 0 else float(random.uniform(0.05, 1.0))
    albedo = float(random.uniform(0.05, 0.9))
    material.base_color, material.ir_albedo = (albedo, albedo, albedo, 1.0), albedo
    material.ior = 1.5
    return material
