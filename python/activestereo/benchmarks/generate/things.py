# SPDX-License-Identifier: Apache-2.0
"""Files of things, one thing each, and their instances in a scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.effects.core.scene_surfaces import instance_transforms
from activestereo.scene_io.scene_files import load_scene_file
from activestereo.scene_io.units import scale, size_hint
from activestereo.scene_io.usd import is_usd

_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
# Place of things that a frame does not show.
_AWAY = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -1000.0], [0, 0, 0, 1]])
# Larger or smaller things are in other units than metres.
_SIZE_M = (1e-3, 5.0)


@dataclass(frozen=True)
class Thing:
    """id: from 1, BOP's obj_id. low_m, high_m: its box in the file's axes, metres. upright: 4x4 from the file's axes to
    axes with z up and the origin in the middle of the box's lower face."""

    id: int
    path: Path
    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]
    upright: NDArray[np.float64]
    radius_m: float  # of the upright thing's footprint
    unit_m: float = 1.0  # of the file


class Things:
    """All things in one scene, away until they are placed. unit_m: of their files."""

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
            base = scale(unit_m) @ instance_transforms(path, len(ids))
            self._instances.append(ids)
            self._base.append(base)
            self.things.append(_thing(number + 1, path, scene.device, unit_m))
        self.place({})

    def place(self, poses: dict[int, NDArray[np.float64]]) -> None:
        """poses: {index: 4x4 from the file's axes to the world}; the others go away."""
        for index, (ids, base) in enumerate(zip(self._instances, self._base, strict=True)):
            self._scene.set_instance_poses(ids, poses.get(index, _AWAY) @ base)

    def is_of(self, index: int, instance_ids: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Mask of this thing in a picture of instances."""
        ids = self._instances[index]
        return (instance_ids >= ids[0]) & (instance_ids <= ids[-1])


def _thing(number: int, path: Path, device: kuafu.Device, unit_m: float) -> Thing:
    alone = kuafu.Scene(device)
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
    return Thing(number, path, low, high, upright, radius, unit_m)
