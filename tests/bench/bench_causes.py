#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How often the cause that a sensor names of a hole is right, for the path tracer and for G-buffers.

    PYTHONPATH=build/python /usr/bin/python3 tests/bench/bench_causes.py --seeds 1:11

Each world is rendered again without the cause, and the pixel is restored where it is then measured: what hides, shades
or lies beside a body goes away and the body stays alone; metal and gloss become matt; what is dark or has little
contrast gets eight times the laser; what is saturated half of the exposure; what is not unique another pattern.
named: holes whose cause is not 'checks'. Holes without a surface, and those beside the other camera's image, which
nothing restores, count in neither.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
from gbuffer_worlds import World
from numpy.typing import NDArray

from activestereo import GBufferStereo, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.sensor.gbuffer.cause import CAUSES

BY_OTHERS = ("occluded", "shadow", "edge")
WITHOUT = {
    "mirror_or_glass": "matt", "too_dark": "light", "low_contrast": "light", "saturated": "dim",
    "not_unique": "pattern",
}  # fmt: skip
Image = NDArray[Any]
Causes = dict[str, Image]


def seen(seed: int, scale: float, samples: int, change: str = "", alone: str = "") -> tuple[Causes, Image, list[str]]:
    """({sensor: causes [height, width]}, the body of each pixel, all names) of a world that was changed."""
    config = StereoDepthSensorConfig("D435").scaled(scale)
    config.samples_per_pixel = samples
    if change == "light":
        config.projector_intensity *= 8.0
    elif change == "dim":
        config.ir_exposure_target_dn *= 0.5
    elif change == "pattern":
        config.pattern_design = replace(config.pattern_design, seed=config.pattern_design.seed + 1)
    world = World.draw(seed)
    if change == "matt":
        world.make_matt()
    if alone:
        world.show_alone(alone)
    with StereoDepthSensor(config, world.scene, pose=world.pose) as sensor:
        sensor.take_picture(infrared_only=True)
        sensor.compute_depth()
        traced = sensor.get_depth_map("cause")
        given = world.gbuffers(sensor)
        instance = sensor.get_picture("instance_id", "left")[..., 0]
    ours = GBufferStereo(config, materials=world.materials(), device="cpu")
    ambient = config.ir_ambient_radiance + world.room_w_per_sr_m2
    return {"traced": traced, "G-buffers": ours(**given, ambient=ambient)["cause"][0]}, instance, world.bodies.names


def judged(
    seed: int, scale: float, samples: int, holes: dict[str, Counter[str]], good: dict[str, Counter[str]]
) -> None:
    """Counts the holes of one world by cause, and those that are restored without it."""
    before, instance, names = seen(seed, scale, samples)
    unmeasured = {name: before[name] != CAUSES.index("measured") for name in before}
    numbers = [int(n) for n in np.unique(instance) if n < len(names)]
    after = {change: seen(seed, scale, samples, change)[0] for change in sorted(set(WITHOUT.values()))}
    alone = {n: seen(seed, scale, samples, alone=names[n])[0] for n in numbers}
    for sensor, causes in before.items():
        for number, cause in enumerate(CAUSES):
            here = unmeasured[sensor] & (causes == number)
            holes[sensor][cause] += int(here.sum())
            if cause in WITHOUT:
                good[sensor][cause] += _measured(after[WITHOUT[cause]][sensor], here)
            elif cause in BY_OTHERS:
                good[sensor][cause] += sum(_measured(alone[n][sensor], here & (instance == n)) for n in numbers)


def _measured(causes: Image, here: Image) -> int:
    return int((causes[here] == CAUSES.index("measured")).sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1:4", help="FIRST:END, the end not among them (default 1:4)")
    parser.add_argument("--scale", type=float, default=0.5, help="of a D435's images (default 0.5)")
    parser.add_argument("--samples", type=int, default=16, help="of the traced pictures (default 16)")
    args = parser.parse_args()
    first, end = (int(number) for number in args.seeds.split(":"))
    holes: dict[str, Counter[str]] = {"traced": Counter(), "G-buffers": Counter()}
    good: dict[str, Counter[str]] = {"traced": Counter(), "G-buffers": Counter()}
    for seed in range(first, end):
        judged(seed, args.scale, args.samples, holes, good)
    for sensor, counts in holes.items():
        inside = sum(counts.values()) - counts["nothing"] - counts["outside"]
        tried = [cause for cause in CAUSES if cause in WITHOUT or cause in BY_OTHERS]
        restored = sum(good[sensor].values()) / max(sum(counts[cause] for cause in tried), 1)
        print(f"{sensor}: named {1 - counts['checks'] / max(inside, 1):.3f}, restored {restored:.3f}")
        for cause in CAUSES:
            if counts[cause]:
                share = f"restored {good[sensor][cause] / counts[cause]:.3f}" if cause in tried else ""
                print(f"  {cause:16} {counts[cause]:8d}  {share}")


if __name__ == "__main__":
    main()
