# SPDX-License-Identifier: Apache-2.0
"""Places things on the table z = 0: upright and side by side, or dropped."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.generate.ranges import Ranges
from activestereo.benchmarks.generate.things import Thing

Poses = dict[int, NDArray[np.float64]]
Layout = Callable[[list[Thing], Ranges, np.random.Generator], Poses]

_TRIES = 200
_STEP_S, _LONGEST_S, _REST_M_PER_S = 0.002, 4.0, 0.01


def chosen(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> list[int]:
    """Chooses a frame's things."""
    count = min(max(ranges.count("things", random), 1), len(things))
    return sorted(random.permutation(len(things))[:count].tolist())


def scatter(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> Poses:
    """Places things upright, turned at random, without contact of their bounding circles. Leaves out things without a
    place after many tries."""
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
                pose = _turned_about_z(random.uniform(0.0, 2.0 * np.pi))
                pose[:2, 3] = at
                out[index] = pose @ things[index].upright
                break
    return out


def physics() -> tuple[Any, Any]:
    """The modules mujoco and trimesh. Raises ImportError if one is missing."""
    try:
        import mujoco
        import trimesh
    except ImportError as error:
        raise ImportError(f"the layout 'drop' needs the package {error.name} (pip install mujoco trimesh)") from error
    return mujoco, trimesh


def drop(things: list[Thing], ranges: Ranges, random: np.random.Generator) -> Poses:
    """Drops things, turned at random, one above the other, with MuJoCo's physics and their convex hulls. Leaves out
    things that roll away. Raises ImportError without mujoco or trimesh."""
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
        middle = _rotation(turn) @ (0.5 * (thing.low_m + thing.high_m))
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


def _turned_about_z(angle: float) -> NDArray[np.float64]:
    out = np.eye(4)
    out[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return out


def _rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation of a quaternion w, x, y, z of any length."""
    from activestereo.common.pose_arrays import pose_matrices

    return pose_matrices(np.concatenate([np.zeros(3), quaternion]), "a turn")[:3, :3]
