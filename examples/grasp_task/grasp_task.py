# SPDX-License-Identifier: Apache-2.0
"""Measures what a gripper's wrist camera gives in each mode of depth, and how often one who knows the state grasps.

PYTHONPATH=build/python python3 examples/grasp_task/grasp_task.py --out out/grasp_task
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from activestereo.sensor.depth_modes import MODES
from stereo_grasp import GraspWorld, teacher

STEPS_BEFORE_PICTURE = 3


def run(out: Path, environments: int, samples: int) -> float:
    """Writes grasp_task.png, a row for each mode; returns the teacher's rate of success."""
    rows = []
    for mode in MODES:
        world = GraspWorld(environments, mode, samples_per_pixel=samples, seed=1)
        world.reset(seed=3)
        for _ in range(STEPS_BEFORE_PICTURE):
            world.step(teacher(world))
        depth = world.look()
        rows.append(np.hstack(list(255 * np.clip((0.55 - depth) / 0.4, 0, 1) * (depth > 0))))
        print(f"{mode}: {100 * (depth > 0).mean():.0f} % measured")
    out.mkdir(parents=True, exist_ok=True)
    picture = Image.fromarray(np.vstack(rows).astype(np.uint8))
    picture = picture.resize((2 * picture.width, 2 * picture.height), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(picture)
    for row, mode in enumerate(MODES):
        draw.text((4, row * picture.height // len(MODES) + 4), mode, fill=255, stroke_width=1, stroke_fill=0)
    draw.text(
        (4, picture.height - 14), "0.15 m white, 0.55 m and unmeasured black", fill=255, stroke_width=1, stroke_fill=0
    )
    picture.save(out / "grasp_task.png")
    world, held = GraspWorld(environments, "clean", seed=1), []
    for _ in range(8):
        world.reset()
        ended = np.zeros(environments, bool)
        while not ended.all():
            ended, succeeded = world.step(teacher(world))
        held += succeeded.tolist()
    print(f"the teacher, who knows the state, holds {100 * np.mean(held):.0f} % of {len(held)} things")
    return float(np.mean(held))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/grasp_task"), help="folder of the picture")
    parser.add_argument("--environments", type=int, default=6)
    parser.add_argument("--samples", type=int, default=4, help="samples per pixel")
    options = parser.parse_args()
    run(options.out, options.environments, options.samples)


if __name__ == "__main__":
    main()
