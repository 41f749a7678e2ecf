#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Depth from nothing, and true pixels lost to the presets' check for more than noise, by the size of the image.

    PYTHONPATH=build/python /usr/bin/python3 tests/bench/bench_invented.py [--models D435 D415] [--spp 4]

nothing: share of an empty background behind three sheets of 0.24 to 0.6 m that gets a depth, in a dark, a dim and a
bright room (0, 0.05 and 0.25 W/(sr m^2)). far: the same, 4 px at 848 or more away from the sheets, which a matcher
widens. black: share of a sheet of albedo 0.01 before a wall that gets one. Each without the check, and with it. lost:
share of the right pixels (within half a pixel of the truth) that the check takes from the example scene and from two
tables of gbuffer_worlds.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import cv2
import numpy as np
from gbuffer_worlds import World
from numpy.typing import NDArray

import kuafu
from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.common.pose import Pose, body_pose
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD, write_table_top

Map = NDArray[np.float32]
SIZES: tuple[tuple[float, ...], ...] = ((1,), (0.5,), (0.25,), (128, 128))  # of scaled(), or of resized()
ROOMS = (0.0, 0.05, 0.25)
RIM_PX = 4 / 848
SHEETS = ((0.8, 0.12, 0.5, 0.2, 0.0), (1.2, 0.15, 0.4, -0.3, 0.1), (2.0, 0.3, 0.5, 0.1, -0.4))  # as _scene() has them
BLACK = (1.0, 0.15, 0.01, 0.0, 0.0)
WALL = (1.3, 1.2, 0.5, 0.0, 0.0)


def _scene(sheets: Iterable[tuple[float, ...]], room: float) -> kuafu.Scene:
    """sheets: distance, half a side, albedo, and the middle to the left and above, in SAPIEN's axes."""
    scene = kuafu.Scene(kuafu.Device())
    for x, half, albedo, left, up in sheets:
        corners = np.array([[x, left + y, up + z] for y in (-half, half) for z in (-half, half)], np.float32)
        material = kuafu.Material(base_color=(albedo, albedo, albedo, 1.0), specular=0.0)
        mesh = scene.add_mesh(corners, np.array([[0, 1, 3], [0, 3, 2]], np.uint32))
        scene.add_instance(mesh, [scene.add_material(material)])
    scene.set_environment((room, room, room))
    return scene


def _things() -> Iterator[tuple[kuafu.Scene, Pose]]:
    with tempfile.TemporaryDirectory() as folder:
        write_table_top(path := Path(folder) / "table_top.gltf")
        scene = kuafu.Scene(kuafu.Device())
        scene.load(path)
    scene.set_environment((0.1, 0.1, 0.1))
    yield scene, body_pose(CAMERA_TO_WORLD)
    for seed in (0, 1):
        world = World.draw(seed)
        yield world.scene, world.pose


def _seen(config: StereoDepthSensorConfig, scene: kuafu.Scene, pose: Pose | None = None) -> tuple[Map, Map, Map]:
    """Disparities without the check and with it, and true ones; 0 = nothing there."""
    with StereoDepthSensor(config, scene, pose=pose or Pose()) as sensor:
        sensor.take_picture(infrared_only=True)
        link, engine, found = sensor._engine.picture().link, sensor.make_engine(), []
        lasers = dict(zip(("left_laser", "right_laser"), link.laser().images(), strict=True))
        for sigma in (0.0, config.min_detection_sigma):
            engine.set_parameters(min_detection_sigma=sigma)
            found.append(np.squeeze(engine.compute(*link.images(), ("disparity",), **lasers)["disparity"]))
        depth = sensor.get_picture("depth", camera="left")[..., 0]
    return *found, np.divide(config.focal_baseline_px_m, depth, where=depth > 0, out=np.zeros_like(depth))


def _share(pairs: list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]) -> float:
    """Percent of the second that the first has."""
    return 100 * sum(int((a & b).sum()) for a, b in pairs) / max(sum(int(b.sum()) for _, b in pairs), 1)


def row(config: StereoDepthSensorConfig) -> list[float]:
    rim = 2 * max(1, round(RIM_PX * config.ir_resolution[0])) + 1
    voids = [_seen(config, _scene(SHEETS, room)) for room in ROOMS]
    empty = [truth == 0 for *_, truth in voids]
    far = [cv2.erode(e.astype(np.uint8), np.ones((rim, rim))) > 0 for e in empty]
    blacks = [_seen(config, _scene((WALL, BLACK), room)) for room in ROOMS]
    near_px = config.focal_baseline_px_m / (0.5 * (WALL[0] + BLACK[0]))
    dark = [truth > near_px for *_, truth in blacks]
    found = [
        _share([(view[which] >= 0, where) for view, where in zip(views, places, strict=True)])
        for views, places in ((voids, empty), (voids, far), (blacks, dark))
        for which in (0, 1)
    ]
    things = [_seen(config, scene, pose) for scene, pose in _things()]
    kept = [(after >= 0, (truth > 0) & (before >= 0) & (abs(before - truth) < 0.5)) for before, after, truth in things]
    return [round(value, 2) for value in (*found, 100 - _share(kept))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", default=["D435", "D415"])
    parser.add_argument("--spp", type=int, default=4, help="samples per pixel (default: 4)")
    args = parser.parse_args()
    print("| | nothing, unchecked % | nothing % | far, unchecked % | far % | black, unchecked % | black % | lost % |")
    print(f"|{'--|' * 8}")
    for model in args.models:
        for size in SIZES:
            config = StereoDepthSensorConfig(model)
            config = config.resized(*size) if len(size) == 2 else config.scaled(*size)
            config.samples_per_pixel = args.spp
            width, height = config.ir_resolution
            print(f"| {model}, {width}x{height} | {' | '.join(map(str, row(config)))} |", flush=True)


if __name__ == "__main__":
    main()
