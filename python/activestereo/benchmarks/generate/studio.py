# SPDX-License-Identifier: Apache-2.0
"""Takes the frames of a data set: a table, objects on it, lamps, and a depth sensor that looks at them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.benchmarks.generate.layout import LAYOUTS, Ranges, Things
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.pose import CAMERA_TO_BODY, look_at
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import add_mesh
from activestereo.scene_io.scene_files import keep_transparent
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.mounts import Mounts
from activestereo.sensor.pictures import PictureMemory

_TABLE_HALF_M = 2.0
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Settings:
    """The settings of a data set. layout: 'scatter' or 'drop'. sensor: a preset's name or a camera's .toml file.
    ir_size: (width, height) of the infrared images, None = the sensor's. unit_m: metres per unit of the things' files.
    keep_transparent: materials of opacity 0 stay invisible."""

    things: tuple[Path, ...]
    sensor: str = "d435"
    rgb_size: tuple[int, int] = (640, 480)
    ir_size: tuple[int, int] | None = None
    samples: int = 16
    seed: int = 0
    layout: str = "scatter"
    ranges: Ranges = Ranges()
    unit_m: float = 1.0
    keep_transparent: bool = False
    device: str | int = "auto"


@dataclass(frozen=True)
class Found:
    """A thing in a frame. model_to_camera: 4x4, metres, camera axes. mask: bool [h, w], the whole thing as if nothing
    occluded it. mask_visible: its visible part."""

    thing_id: int
    model_to_camera: NDArray[np.float64]
    mask: NDArray[np.bool_]
    mask_visible: NDArray[np.bool_]


@dataclass(frozen=True)
class Frame:
    """The pictures of a frame. rgb: uint8 [h, w, 3]; left, right: uint8 or uint16 infrared images; depth, true_depth:
    float32 [h, w] metres in the RGB camera, 0 = none; confidence: float32 0..1, and reason: uint8, an index into
    simsense.REASONS, both in the left infrared camera. found: the things that were placed."""

    number: int
    rgb: NDArray[np.uint8]
    left: NDArray[np.integer]
    right: NDArray[np.integer]
    depth: NDArray[np.float32]
    true_depth: NDArray[np.float32]
    confidence: NDArray[np.float32]
    reason: NDArray[np.uint8]
    k: NDArray[np.float64]
    world_to_camera: NDArray[np.float64]
    found: tuple[Found, ...]


def things_of(settings: Settings, scene: kuafu.Scene) -> Things:
    """Adds the things of a data set to a scene and returns them."""
    if settings.keep_transparent:
        keep_transparent()
    return Things(scene, list(settings.things), settings.unit_m)


class Studio:
    """Takes any frame of a data set, in any order. Use it in one thread at a time."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._scene = kuafu.Scene(kuafu.Device(settings.device))
        self._table = self._scene.add_material(kuafu.Material(name="table"))
        slab = np.diag([_TABLE_HALF_M, _TABLE_HALF_M, 0.02, 1.0])
        slab[2, 3] = -0.02
        self._scene.add_instance(add_mesh(self._scene, solids.box()), [self._table], local_to_world=slab, name="table")
        self._things = things_of(settings, self._scene)
        self._lamps: list[int] = []
        self._mounts = Mounts(self._scene, np.eye(4)[None])
        self._config = sensor_config(settings)
        self._sensor = StereoDepthSensorBatch(self._config, self._mounts)
        self._renderer = kuafu.Renderer(self._scene.device)
        width, height = self._config.rgb_resolution
        self._alone_ids = PictureMemory(self._scene.device, (1, height, width), {"instance_id": (np.uint32, 1)})

    def make_frame(self, number: int) -> Frame:
        """Takes frame `number` of the data set, which depends only on the settings and the number."""
        settings, random = self._settings, np.random.default_rng([self._settings.seed, number])
        poses = LAYOUTS[settings.layout](self._things.things, settings.ranges, random)
        # 1. The table, the lamps and the camera.
        ranges, scene = settings.ranges, self._scene
        material = scene.get_material(self._table)
        grey, tint = ranges.draw("table_albedo", random), random.uniform(0.7, 1.0, 3)
        red, green, blue = (float(v) for v in grey * tint)
        material.base_color = (red, green, blue, 1.0)
        material.ir_albedo = grey
        material.roughness = ranges.draw("table_roughness", random)
        scene.set_material(self._table, material)
        ambient = ranges.draw("ambient_radiance", random)
        scene.set_environment((ambient, ambient, ambient))
        for lamp in self._lamps:
            scene.remove_light(lamp)
        self._lamps = []
        for _ in range(ranges.count("lamps", random)):
            lamp_to_world = np.eye(4)
            lamp_to_world[:3, 3] = random.uniform([-1.0, -1.0, 1.0], [1.0, 1.0, 2.0])
            power = ranges.draw("lamp_w_per_sr", random)
            light = kuafu.Light(kind="point", intensity=(power, power, power), light_to_world=lamp_to_world)
            self._lamps.append(scene.add_light(light))
        azimuth = random.uniform(0.0, 2.0 * np.pi)
        elevation, distance = np.deg2rad(ranges.draw("elevation_deg", random)), ranges.draw("distance_m", random)
        way = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        target = np.array([*random.uniform(-0.03, 0.03, 2), 0.03])
        camera_to_world = look_at(target + distance * way, target, _UP)
        roll = np.deg2rad(ranges.draw("roll_deg", random))
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]]
        camera_to_world = camera_to_world @ turn
        # 2. The pictures.
        self._things.place(poses)
        self._mounts.poses = (camera_to_world @ CAMERA_TO_BODY.T)[None]
        self._sensor.restart(int(random.integers(2**31)))
        self._sensor.take_picture()
        self._sensor.compute_depth()
        left, right = self._sensor.get_ir_measured()
        world_to_camera = np.linalg.inv(camera_to_world)
        seen = self._sensor.get_instance_ids()[0].copy()
        return Frame(
            number=number,
            rgb=np.ascontiguousarray(self._sensor.get_rgba8()[0, ..., :3]),
            left=left[0].copy(),
            right=right[0].copy(),
            depth=self._sensor.get_depth()[0].copy(),
            true_depth=self._sensor.get_true_depth()[0].copy(),
            confidence=self._sensor.get_depth_map("confidence")[0].copy(),
            reason=self._sensor.get_depth_map("reason")[0].copy(),
            k=self._config.rgb_intrinsic,
            world_to_camera=world_to_camera,
            found=tuple(
                Found(
                    self._things.things[index].id,
                    world_to_camera @ pose,
                    self._alone(index, pose, camera_to_world),
                    self._things.is_of(index, seen),
                )
                for index, pose in poses.items()
            ),
        )

    def _alone(self, index: int, pose: NDArray[np.float64], camera_to_world: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Returns the mask in the RGB picture, [height, width], of thing number `index` without all other things. pose:
        4x4 from its file's axes to the world."""
        self._things.place({index: pose})
        width, height = self._config.rgb_resolution
        camera = kuafu.Camera(width, height, self._config.rgb_intrinsic, camera_to_world)
        self._alone_ids.forget()
        self._renderer.render(self._scene, camera, self._alone_ids.targets, band="visible", spp=1)
        return self._things.is_of(index, self._alone_ids.read("instance_id")[0, ..., 0])


def sensor_config(settings: Settings) -> StereoDepthSensorConfig:
    """Returns the preset with an RGB image of the wanted size, cut or widened about its middle. It has no distortion,
    because BOP's cameras are pinholes. Infrared cameras of another size keep their horizontal field of view."""
    config = StereoDepthSensorConfig(settings.sensor)
    if settings.ir_size is not None:
        whole, config = config, config.resized(*settings.ir_size)
        for name in vars(whole):
            if name.startswith("rgb_"):
                setattr(config, name, getattr(whole, name))
    width, height = settings.rgb_size
    old_width, old_height = config.rgb_resolution
    scale = height / old_height
    k = np.array(config.rgb_intrinsic, np.float64)
    k[:2, :2] *= scale
    k[:2, 2] = (k[:2, 2] - 0.5 * (np.array([old_width, old_height]) - 1.0)) * scale
    k[:2, 2] += 0.5 * (np.array([width, height]) - 1.0)
    config.rgb_resolution, config.rgb_intrinsic = (width, height), k
    config.rgb_distortion = (0.0,) * 5
    config.samples_per_pixel = settings.samples
    if config.ir_exposure_mode == "converging":
        config.ir_exposure_mode = "settled"
    return config
