# SPDX-License-Identifier: Apache-2.0
"""Depth cameras in a simulator of one's own: balls that bounce in eight environments at once, held in NumPy arrays.

PYTHONPATH=build/python python3 examples/any_simulator/any_simulator.py --out out/any_simulator
"""

import argparse
from pathlib import Path

import kuafu
import numpy as np

from activestereo import Mounts, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh
from activestereo.common.pose import body_pose, look_at
from activestereo.report.pictures import labelled_figure
from activestereo.report.lettering import write_figure

BALLS, RADIUS_M, STEP_S = 5, 0.05, 0.01


class Simulator:
    """Balls that fall, bounce on the floor and lose a fifth of their speed: all that our side knows of it is poses."""

    def __init__(self, environments: int, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.poses = np.zeros((environments, BALLS, 7))  # x, y, z and the quaternion w, x, y, z
        self.poses[..., :2] = random.uniform(-0.25, 0.25, (environments, BALLS, 2))
        self.poses[..., 2] = random.uniform(0.2, 0.6, (environments, BALLS))
        self.poses[..., 3] = 1.0
        self.speed = np.zeros((environments, BALLS))

    def step(self) -> None:
        self.speed -= 9.81 * STEP_S
        self.poses[..., 2] += self.speed * STEP_S
        has_hit = self.poses[..., 2] < RADIUS_M
        self.poses[..., 2][has_hit] = RADIUS_M
        self.speed[has_hit] *= -0.8


def make_bodies(environments: int) -> Bodies:
    """The scene, made once: a floor that all environments share, and each one's own balls."""
    scene = kuafu.Scene(kuafu.Device())
    scene.set_environment((0.4, 0.4, 0.4))
    floor = scene.add_material(kuafu.Material(name="floor", base_color=(0.5, 0.5, 0.45, 1.0), specular=0.0))
    slab = np.diag([1.0, 1.0, 0.02, 1.0])
    slab[2, 3] = -0.02
    scene.add_instance(add_mesh(scene, solids.box()), [floor], local_to_world=slab)
    bodies, sphere = Bodies(scene, environments), add_mesh(scene, solids.sphere())
    for k in range(BALLS):
        red = 0.2 + 0.6 * k / BALLS
        paint = scene.add_material(kuafu.Material(base_color=(red, 0.5, 1.0 - red, 1.0), roughness=0.5))
        bodies.add(f"ball {k}", [Shape(sphere, [paint], np.diag([RADIUS_M, RADIUS_M, RADIUS_M, 1.0]))])
    return bodies


def run(out: Path, environments: int, pictures: int, samples: int) -> float:
    """Writes any_simulator.png; returns the share of measured pixels within 2 % of the true depth."""
    simulator, bodies = Simulator(environments, seed=1), make_bodies(environments)
    config = StereoDepthSensorConfig("sapien-D435").scaled(0.25)
    config.samples_per_pixel = samples
    place = body_pose(look_at((-0.55, 0.0, 0.65), (0.0, 0.0, 0.05), (0.0, 0.0, 1.0)))
    standing = np.broadcast_to([*place.p, *place.q], (environments, 7))
    with StereoDepthSensorBatch(config, Mounts(bodies.scene, standing)) as cameras:
        for k in range(pictures):
            for _ in range(12):
                simulator.step()
            moved = bodies.move(simulator.poses)
            cameras.take_picture(infrared_only=k + 1 < pictures)
            cameras.compute_depth()
            depth = cameras.get_depth()  # [environments, height, width]
            print(f"picture {k + 1} of {pictures}: {moved} balls moved, {100 * (depth > 0).mean():.1f} % measured")
        truth, rgb = cameras.get_true_depth(), cameras.get_rgb()
    measured = (depth > 0) & (truth > 0)
    good = np.abs(depth - truth)[measured] < 0.02 * truth[measured]
    print(f"{100 * good.mean():.1f} % of the measured pixels are within 2 % of the true depth")
    out.mkdir(parents=True, exist_ok=True)
    shown = range(min(4, environments))
    pictures = [(f"environment {e}: colour", rgb[e], None) for e in shown]
    pictures += [("depth that the sensor measures", depth[e], (0.4, 1.4)) for e in shown]
    write_figure(out / "any_simulator.png", labelled_figure(pictures, columns=len(shown)))
    return float(good.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/any_simulator"), help="folder of the picture")
    parser.add_argument("--environments", type=int, default=8)
    parser.add_argument("--pictures", type=int, default=3)
    parser.add_argument("--samples", type=int, default=8, help="samples per pixel")
    options = parser.parse_args()
    run(options.out, options.environments, options.pictures, options.samples)


if __name__ == "__main__":
    main()
