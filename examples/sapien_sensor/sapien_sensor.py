# SPDX-License-Identifier: Apache-2.0
"""SAPIEN's depth sensor on a machine where SAPIEN can neither render nor find CUDA.

    PYTHONPATH=build/python python3 examples/sapien_sensor/sapien_sensor.py --out out/sapien_sensor

Needs the package sapien (pip install sapien).
"""

import argparse
import sys
from pathlib import Path

import numpy as np

try:
    import sapien
except ImportError:
    sys.exit("this example needs the package sapien: pip install sapien")

from activestereo.integrations.sapien import ActorBuilder, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.report.pictures import labelled_figure
from activestereo.report.lettering import write_figure


def make_scene() -> tuple[sapien.Scene, sapien.Entity]:
    """A table with boxes and capsules that fall, and an entity to mount a sensor on."""
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    scene.set_timestep(1 / 100)
    table = ActorBuilder(scene)
    table.add_box_collision(half_size=[0.6, 0.6, 0.02])
    table.add_box_visual(half_size=[0.6, 0.6, 0.02], material=[0.6, 0.45, 0.3])
    table.set_initial_pose(sapien.Pose([0, 0, -0.02]))
    table.build_static("table")
    random = np.random.Generator(np.random.PCG64(3))
    for k in range(8):
        size, colour = random.uniform(0.02, 0.06, 3).tolist(), random.uniform(0.2, 0.9, 3).tolist()
        builder = ActorBuilder(scene)
        if k % 2:
            builder.add_box_collision(half_size=size)
            builder.add_box_visual(half_size=size, material=colour)
        else:
            builder.add_capsule_collision(radius=size[0], half_length=size[1])
            builder.add_capsule_visual(radius=size[0], half_length=size[1], material=colour)
        builder.set_initial_pose(sapien.Pose([*random.uniform(-0.2, 0.2, 2), 0.1 + 0.12 * k]))
        builder.build(f"thing {k}")
    mount = sapien.Entity()
    down = np.deg2rad(38)
    mount.set_pose(sapien.Pose([-0.65, 0, 0.5], [np.cos(down / 2), 0, np.sin(down / 2), 0]))
    scene.add_entity(mount)
    return scene, mount


def run(out: Path, scale: float, samples: int, steps: int) -> float:
    """Writes sapien_sensor.png; returns the share of measured pixels within 2 % of the true depth."""
    scene, mount = make_scene()
    config = StereoDepthSensorConfig("D435").scaled(scale)
    config.samples_per_pixel = samples
    sensor = StereoDepthSensor(config, mount)
    for _ in range(steps):
        scene.step()
    sensor.take_picture()
    sensor.compute_depth()
    depth, truth = sensor.get_depth(), sensor.native().get_true_depth()
    measured = (depth > 0) & (truth > 0)
    good = np.abs(depth - truth)[measured] < 0.02 * truth[measured]
    print(f"{100 * measured.mean():.1f} % measured, {100 * good.mean():.1f} % of that within 2 % of the true depth")
    out.mkdir(parents=True, exist_ok=True)
    pictures = [
        ("colour", sensor.get_rgb(), None),
        ("depth that the D435 measures", depth, (0.5, 1.4)),
        ("true depth", truth, (0.5, 1.4)),
    ]
    write_figure(out / "sapien_sensor.png", labelled_figure(pictures, columns=3))
    # SAPIEN ends the process where a scene without a renderer goes with its entities.
    for entity in list(scene.entities):
        scene.remove_entity(entity)
    return float(good.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/sapien_sensor"), help="folder of the picture")
    parser.add_argument("--scale", type=float, default=0.5, help="size of the images, of a D435's")
    parser.add_argument("--samples", type=int, default=16, help="samples per pixel")
    parser.add_argument("--steps", type=int, default=150, help="steps of physics before the picture")
    options = parser.parse_args()
    run(options.out, options.scale, options.samples, options.steps)


if __name__ == "__main__":
    main()
