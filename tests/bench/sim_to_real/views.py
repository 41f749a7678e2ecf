# SPDX-License-Identifier: Apache-2.0
"""Poses of object and camera in view n, and the start pose of a method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_to_real.objects import BenchmarkObject
from activestereo.common.pose import look_at

# Methods are tuned on the views of one split and scored on the other's.
SPLITS = ("tuning", "test")
_OBJECT_SPREAD_M = 0.03
_DISTANCE_M, _ELEVATION_DEG = (0.4, 0.55), (30.0, 65.0)
# Errors of a detector's guess: the turn, and the standard deviation of each coordinate.
_START_TURN_DEG, _START_SIGMA_M = 12.0, 0.01


@dataclass(frozen=True)
class View:
    """Poses are 4x4 to the world with the table at z = 0. start: the object's, as a detector guesses it."""

    object_index: int
    object_to_world: NDArray[np.float64]
    camera_to_world: NDArray[np.float64]
    start: NDArray[np.float64]


def round_of_views(objects: tuple[BenchmarkObject, ...], seed: int, split: str, number: int) -> list[View]:
    """Round `number` of a split: one view of each object. It depends on these arguments alone."""
    return [
        _view(thing, index, np.random.default_rng([seed, SPLITS.index(split), number, index]))
        for index, thing in enumerate(objects)
    ]


def _view(thing: BenchmarkObject, index: int, random: np.random.Generator) -> View:
    yaw = random.uniform(0.0, 2.0 * np.pi)
    object_to_world = np.eye(4)
    object_to_world[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    object_to_world[:3, 3] = *random.uniform(-_OBJECT_SPREAD_M, _OBJECT_SPREAD_M, 2), thing.rest_m
    azimuth, elevation = random.uniform(0.0, 2.0 * np.pi), np.deg2rad(random.uniform(*_ELEVATION_DEG))
    way = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    middle = object_to_world[:3, 3] + random.uniform(-0.01, 0.01, 3)
    camera_to_world = look_at(middle + random.uniform(*_DISTANCE_M) * way, middle, (0.0, 0.0, 1.0))
    start = object_to_world.copy()
    axis = random.standard_normal(3)
    start[:3, :3] = rotation(np.deg2rad(_START_TURN_DEG) * axis / np.linalg.norm(axis)) @ start[:3, :3]
    start[:3, 3] += _START_SIGMA_M * random.standard_normal(3)
    return View(index, object_to_world, camera_to_world, start)


def rotation(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """3x3 of a rotation vector, radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)
