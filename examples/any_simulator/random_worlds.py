# SPDX-License-Identifier: Apache-2.0
"""Environments of a batch that differ in bodies, materials, lamps and sensors:

    PYTHONPATH=build/python python3 examples/any_simulator/random_worlds.py
"""

from pathlib import Path

import kuafu
import numpy as np
from PIL import Image

from activestereo import Mounts, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.sensor.random_worlds import RandomWorlds, WorldRanges, drawn_bodies

RANGES = WorldRanges(bodies=(2, 5), lamps=(1, 3), albedo_factor=(0.3, 1.2), laser_power=(0.5, 1.0), exposure=(0.7, 1.4))


def run(out: Path, environments: int = 6, samples: int = 8, seed: int = 1) -> list[float]:
    """Writes RGB and depth of each environment; returns the measured share of each."""
    scene, random = kuafu.Scene(kuafu.Device()), np.random.default_rng(seed)
    bodies, ball = Bodies(scene, environments), add_mesh(scene, solids.sphere())
    has = drawn_bodies(RANGES, environments, 6, seed)
    for k in range(6):
        paint = scene.add_material(kuafu.Material(base_color=(0.2 + 0.1 * k, 0.5, 0.8 - 0.1 * k, 1.0)))
        shape = Shape(ball, [paint], np.diag([0.07, 0.07, 0.07, 1.0]))
        at = [0.7 + 0.1 * (k % 2), *random.uniform(-0.25, 0.25, 2), 1, 0, 0, 0]
        bodies.add(f"ball {k}", [shape], pose=at, environments=np.flatnonzero(has[:, k]))
    wall = Shape(add_mesh(scene, solids.box()), [scene.add_material(kuafu.Material())], np.diag([0.1, 2, 2, 1.0]))
    bodies.add("wall", [wall], pose=[1.2, 0, 0, 1, 0, 0, 0])
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel = samples
    cameras = StereoDepthSensorBatch(config, Mounts(scene, [[0, 0, 0, 1, 0, 0, 0]] * environments))
    RandomWorlds(bodies, cameras, RANGES, seed).draw()
    cameras.take_picture()
    cameras.compute_depth()
    depth = cameras.get_depth()
    shades = np.repeat((np.clip((1.5 - depth) / 1.0, 0, 1) * (depth > 0))[..., None], 3, axis=-1)
    rows = [np.hstack(list(tiles)) for tiles in (cameras.get_rgb(), shades)]
    out.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((255 * np.vstack(rows)).astype(np.uint8)).save(out)
    return [float(share) for share in (depth > 0).mean(axis=(1, 2))]


if __name__ == "__main__":
    print("measured:", ", ".join(f"{100 * share:.1f} %" for share in run(Path("out/any_simulator/random_worlds.png"))))
