# SPDX-License-Identifier: Apache-2.0
"""Takes the frames of a data set: objects on a table, upright side by side or dropped, lamps, and a depth sensor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.input_files import read_toml
from activestereo.common.optional import imported
from activestereo.common.pose import CAMERA_TO_BODY, look_at, pose_matrices, rigid_motion
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import add_mesh
from activestereo.scene_io.scene_files import keep_transparent, load_scene_file, size_hint
from activestereo.scene_io.usd import is_usd
from activestereo.sensor.batch import StereoDepthSensorBatch
from activestereo.sensor.mounts import Mounts


@dataclass(frozen=True)
class Ranges:
    """Ranges (low, high), from which each frame's values are drawn uniformly. LIMITS: {field: lowest and highest
    allowed ends}, by default 0 and 1e6. Raises ValueError with the range and its fault."""

    things: tuple[float, float] = (3, 6)  # count, at most the number of files
    spread_m: tuple[float, float] = (0.15, 0.25)  # radius of the area of things
    distance_m: tuple[float, float] = (0.5, 1.0)  # from the camera to the middle of the table
    elevation_deg: tuple[float, float] = (30, 80)  # height of the camera above the table
    roll_deg: tuple[float, float] = (-10, 10)
    lamps: tuple[float, float] = (1, 3)  # count
    lamp_w_per_sr: tuple[float, float] = (0.5, 3.0)
    ambient_radiance: tuple[float, float] = (0.05, 0.4)
    table_albedo: tuple[float, float] = (0.1, 0.8)
    table_roughness: tuple[float, float] = (0.3, 1.0)

    LIMITS: ClassVar[dict[str, tuple[float, float]]] = {
        "roll_deg": (-360.0, 360.0),
        "spread_m": (0.0, 100.0),
        "distance_m": (0.05, 100.0),
        "elevation_deg": (1.0, 89.9),
        "table_albedo": (0.0, 1.0),
    }

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            is_pair = isinstance(value, (tuple, list)) and len(value) == 2
            if not is_pair or not all(isinstance(v, (int, float)) and np.isfinite(v) for v in value):
                raise ValueError(f"the range {name} is two finite numbers, low and high, not {value}")
            low, high = value
            least, most = self.LIMITS.get(name, (0.0, 1e6))
            if low > high:
                raise ValueError(f"the range {name} goes from {low} to {high}; it must rise from at least {least:g}")
            if not least <= low <= high <= most:
                raise ValueError(f"the range {name} must lie within {least:g} to {most:g}, not {(low, high)}")
            object.__setattr__(self, name, (low, high))

    @classmethod
    def read(cls, path: Path | None) -> Ranges:
        """Reads a .toml file; ranges that it lacks, or all if `path` is None, keep their defaults. Raises ValueError
        with the file and its fault."""
        given = {} if path is None else read_toml(path)
        try:
            known = sorted(field.name for field in fields(cls))
            if unknown := sorted(set(given) - set(known)):
                raise ValueError(f"there is no range '{unknown[0]}' (known: {', '.join(known)})")
            return cls(**given)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error

    def draw(self, name: str, random: np.random.Generator) -> float:
        return float(random.uniform(*getattr(self, name)))

    def count(self, name: str, random: np.random.Generator) -> int:
        low, high = getattr(self, name)
        return int(random.integers(int(low), int(high) + 1))


_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
# Pose of things that a frame does not show.
_AWAY = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -1000.0], [0, 0, 0, 1]])
# Things outside this range of sizes must be in another unit than metres.
_SIZE_M = (1e-3, 5.0)


@dataclass(frozen=True)
class Thing:
    """An object of the data set. id: from 1, BOP's obj_id. low_m, high_m: its box in the file's axes, metres. upright:
    4x4 from the file's axes to axes with z up and the origin in the middle of the box's lower face."""

    id: int
    path: Path
    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]
    upright: NDArray[np.float64]
    radius_m: float  # radius of the upright thing's footprint
    unit_m: float = 1.0  # metres per unit of the file


class Things:
    """Adds all objects to a scene, far away until place() moves them. unit_m: metres per unit of their files."""

    def __init__(self, scene: kuafu.Scene, paths: list[Path], unit_m: float = 1.0) -> None:
        self._scene = scene
        self.things: list[Thing] = []
        self._instances: list[NDArray[np.uint32]] = []
        self._base: list[NDArray[np.float64]] = []
        for number, path in enumerate(paths):
            if is_usd(path):
                raise ValueError(f"{path}: a thing is no USD stage: convert it (activestereo.scene_io.usd.convert)")
            first = scene.summary.instance_count
            load_scene_file(scene, path, unit_m=unit_m)
            ids = np.arange(first, scene.summary.instance_count, dtype=np.uint32)
            base = np.array([scene.get_instance(number)["local_to_world"] for number in ids]).reshape(-1, 4, 4)
            self._instances.append(ids)
            self._base.append(base)
            # A scene of its own gives the thing's size.
            alone = kuafu.Scene(scene.device)
            load_scene_file(alone, path, unit_m=unit_m)
            summary = alone.summary
            if not summary.triangle_count:
                raise ValueError(f"{path}: there is nothing to see in it: no triangles")
            low, high = np.array(summary.bounds_min_m), np.array(summary.bounds_max_m)
            size = float(np.max(high - low))
            if not _SIZE_M[0] <= size <= _SIZE_M[1]:
                text = f"{path}: the thing is {size:g} m large; it must be {_SIZE_M[0]:g} to {_SIZE_M[1]:g} m"
                raise ValueError(f"{text}. It is {size_hint(size, unit_m) or 'in another unit, which --unit says'}")
            is_y_up = path.suffix.lower() in (".gltf", ".glb")
            turn = _Y_UP if is_y_up else np.eye(4)
            corners = np.array([turn[:3, :3] @ corner for corner in (low, high)])
            low_up, high_up = corners.min(axis=0), corners.max(axis=0)
            upright = turn.copy()
            upright[:3, 3] = -np.array([*(0.5 * (low_up + high_up))[:2], low_up[2]])
            radius = 0.5 * float(np.hypot(*(high_up - low_up)[:2]))
            self.things.append(Thing(number + 1, path, low, high, upright, radius, unit_m))
        self.place({})

    def place(self, poses: dict[int, NDArray[np.float64]]) -> None:
        """Places things in the world. poses: {index: 4x4 from the file's axes to the world}; the other things move far
        away."""
        for index, (ids, base) in enumerate(zip(self._instances, self._base, strict=True)):
            self._scene.set_instance_poses(ids, poses.get(index, _AWAY) @ base)

    def is_of(self, index: int, instance_ids: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Returns a mask of the pixels of an instance-id picture that show the object number `index`."""
        ids = self._instances[index]
        return (instance_ids >= ids[0]) & (instance_ids <= ids[-1])


Poses = dict[int, NDArray[np.float64]]
Layout = Callable[[list[Thing], Ranges, np.random.Generator], Poses]

_TRIES = 200
_STEP_S, _LONGEST_S, _REST_M_PER_S = 0.002, 4.0, 0.01


def chosen(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> list[int]:
    """Draws at random which objects a frame shows; returns their indices, sorted."""
    count = min(max(ranges.count("things", random), 1), len(things))
    return sorted(random.permutation(len(things))[:count].tolist())


def scatter(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> Poses:
    """Places objects upright, turned at random, without overlap of their footprints' circles. Returns {index: 4x4 from
    the file's axes to the world}. Objects that fit nowhere after many tries are left out."""
    out: Poses = {}
    spread = ranges.draw("spread_m", random)
    circles: list[tuple[NDArray[np.float64], float]] = []
    for index in chosen(things, ranges, random):
        radius = things[index].radius_m
        for _ in range(_TRIES):
            angle, far = random.uniform(0.0, 2.0 * np.pi), spread * np.sqrt(random.uniform())
            at = far * np.array([np.cos(angle), np.sin(angle)])
            if all(np.linalg.norm(at - other) > radius + r for other, r in circles):
                circles.append((at, radius))
                pose, turn = np.eye(4), random.uniform(0.0, 2.0 * np.pi)
                pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
                pose[:2, 3] = at
                out[index] = pose @ things[index].upright
                break
    return out


def physics() -> tuple[Any, Any]:
    """Imports and returns the modules mujoco and trimesh. Raises ImportError if one is missing."""
    text = "the layout 'drop' needs the package {} (pip install mujoco trimesh)"
    mujoco, trimesh = (imported(name, text.format(name)) for name in ("mujoco", "trimesh"))
    return mujoco, trimesh


def drop(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> Poses:
    """Draws some of the objects at random (chosen()) and drops them, stacked and turned at random, with MuJoCo's
    physics on their convex hulls. Returns {index in `things`: 4x4 from the file's axes to the world} once they rest.
    Objects that roll away are left out. Raises ImportError without mujoco or trimesh."""
    mujoco, trimesh = physics()
    spread, order = ranges.draw("spread_m", random), chosen(things, ranges, random)
    spec = mujoco.MjSpec()
    spec.option.timestep = _STEP_S
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5.0, 5.0, 0.1])
    height = 0.05
    for index in order:
        thing = things[index]
        hull = trimesh.load(thing.path, force="mesh").convex_hull
        spec.add_mesh(name=str(index), uservert=thing.unit_m * np.asarray(hull.vertices, np.float64).ravel())
        size = float(np.linalg.norm(thing.high_m - thing.low_m))
        angle, far = random.uniform(0.0, 2.0 * np.pi), 0.5 * spread * np.sqrt(random.uniform())
        turn = random.standard_normal(4)
        turned = pose_matrices(np.concatenate([np.zeros(3), turn]), "a turn")[:3, :3]
        middle = turned @ (0.5 * (thing.low_m + thing.high_m))
        at = np.array([far * np.cos(angle), far * np.sin(angle), height + 0.5 * size]) - middle
        height += size
        body = spec.worldbody.add_body(name=str(index), pos=at, quat=turn / np.linalg.norm(turn))
        body.add_freejoint()
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=str(index), density=700.0, condim=4, friction=[0.6, 0.01, 0.001]
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    while data.time < _LONGEST_S and (data.time < 1.0 or np.abs(data.qvel).max() > _REST_M_PER_S):
        mujoco.mj_step(model, data)
    out: Poses = {}
    for index in order:
        body = data.body(str(index))
        pose = rigid_motion(body.xpos, body.xmat.reshape(3, 3))
        middle = pose[:3, :3] @ (0.5 * (things[index].low_m + things[index].high_m)) + body.xpos
        if np.isfinite(pose).all() and np.hypot(*middle[:2]) < 2.0 * spread and middle[2] > 0.0:
            out[index] = pose
    return out


LAYOUTS: dict[str, Layout] = {"scatter": scatter, "drop": drop}


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
    """A thing in a frame. model_to_camera: 4x4, metres, camera axes. outline: bool [3 h, 3 w], the whole thing as if
    nothing occluded it, in an image whose middle is the picture. mask_visible: bool [h, w], its visible part."""

    thing_id: int
    model_to_camera: NDArray[np.float64]
    outline: NDArray[np.bool_]
    mask_visible: NDArray[np.bool_]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Returns the part of the outline in the picture."""
        height, width = self.mask_visible.shape
        return self.outline[height : 2 * height, width : 2 * width]


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
            lamp_to_world = rigid_motion(random.uniform([-1.0, -1.0, 1.0], [1.0, 1.0, 2.0]))
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
        """Returns the outline, bool [3 height, 3 width], of object number `index` as if it were alone in the scene, in
        an image whose middle is the RGB picture (as BOP's toolkit has it). pose: 4x4 from its file's axes to the
        world."""
        self._things.place({index: pose})
        (width, height), k = self._config.rgb_resolution, self._config.rgb_intrinsic
        thing = self._things.things[index]
        corners = np.array([[*corner, 1.0] for corner in product(*zip(thing.low_m, thing.high_m, strict=True))])
        x, y, z = k @ (np.linalg.inv(camera_to_world) @ pose @ corners.T)[:3]
        is_inside = bool(((z > 0) & (x >= 0) & (x < z * (width - 1)) & (y >= 0) & (y < z * (height - 1))).all())
        beyond = (0, 0) if is_inside else (height, width)  # rows and columns on each side
        shift = np.array([[0, 0, beyond[1]], [0, 0, beyond[0]], [0, 0, 0]])
        camera = kuafu.Camera(width + 2 * beyond[1], height + 2 * beyond[0], k + shift, camera_to_world)
        ids = self._renderer.render(self._scene, camera, ["instance_id"], band="visible", spp=1)["instance_id"]
        mask = self._things.is_of(index, ids[0, ..., 0])
        return np.pad(mask, ((height,) * 2, (width,) * 2)) if is_inside else mask


def sensor_config(settings: Settings) -> StereoDepthSensorConfig:
    """Returns the preset with an RGB image of the settings' size. The image is scaled to the height, and cut or widened
    on both sides to the width. It has no distortion, because BOP's cameras are pinholes. Infrared images of another
    size keep their horizontal field of view."""
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
