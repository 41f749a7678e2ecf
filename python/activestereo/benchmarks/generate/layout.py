# SPDX-License-Identifier: Apache-2.0
"""Objects ("things") of a data set: their files and instances, and the ranges of random values. Places them on the
table z = 0, upright and side by side or dropped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.common.declared_ranges import DeclaredRanges
from activestereo.common.pose import pose_matrices
from activestereo.effects.core.scene_surfaces import instance_transforms
from activestereo.scene_io.scene_files import load_scene_file, size_hint
from activestereo.scene_io.usd import is_usd


@dataclass(frozen=True)
class Ranges(DeclaredRanges):
    """Ranges (low, high), from which each frame's values are drawn uniformly."""

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
        "distance_m": (0.05, 100.0),
        "elevation_deg": (1.0, 89.9),
        "table_albedo": (0.0, 1.0),
    }


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
    """Adds all things to a scene, far away until place() moves them. unit_m: metres per unit of their files."""

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
            base = np.diag([unit_m, unit_m, unit_m, 1.0]) @ instance_transforms(path, len(ids))
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
                raise ValueError(f"{text}. It is {size_hint(size) or 'in another unit, which --unit says'}")
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
        """Returns a mask of the pixels of an instance picture that show the thing number `index`."""
        ids = self._instances[index]
        return (instance_ids >= ids[0]) & (instance_ids <= ids[-1])


Poses = dict[int, NDArray[np.float64]]
Layout = Callable[[list[Thing], Ranges, np.random.Generator], Poses]

_TRIES = 200
_STEP_S, _LONGEST_S, _REST_M_PER_S = 0.002, 4.0, 0.01


def chosen(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> list[int]:
    """Draws which things a frame shows; returns their indices, sorted."""
    count = min(max(ranges.count("things", random), 1), len(things))
    return sorted(random.permutation(len(things))[:count].tolist())


def scatter(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> Poses:
    """Places things upright, turned at random, without overlap of their footprints' circles. Returns {index: 4x4 to the
    world}; leaves out things that find no place after many tries."""
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
    try:
        import mujoco
        import trimesh
    except ImportError as error:
        raise ImportError(f"the layout 'drop' needs the package {error.name} (pip install mujoco trimesh)") from error
    return mujoco, trimesh


def drop(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> Poses:
    """Drops things, turned at random, one above the other, with MuJoCo's physics on their convex hulls. Returns {index:
    4x4 to the world}; leaves out things that roll away. Raises ImportError without mujoco or trimesh."""
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
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = body.xmat.reshape(3, 3), body.xpos
        middle = pose[:3, :3] @ (0.5 * (things[index].low_m + things[index].high_m)) + body.xpos
        if np.isfinite(pose).all() and np.hypot(*middle[:2]) < 2.0 * spread and middle[2] > 0.0:
            out[index] = pose
    return out


LAYOUTS: dict[str, Layout] = {"scatter": scatter, "drop": drop}
