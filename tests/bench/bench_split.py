# SPDX-License-Identifier: Apache-2.0
"""A batch of depth sensors over several devices beside the same batch on one: pairs a second, from take_picture() to
the depth as an array.

usage: PYTHONPATH=build/python python3 tests/bench/bench_split.py [--environments 256] [--scales 0.15,0.3] [--rounds N]
                                                                  [--batches N]

Devices are all discrete GPUs, or the CPU twice, which shows that it works. Each environment has eight balls of its own
before a wall; infrared alone, path depth 3, 4 samples. The least of the rounds counts, and in brackets what that one
took beyond the devices' own stages, of the picture and of the depth. Depths are compared bit for bit. With --batches
above 1 each device has as many, each with a scene and a thread: one's depth is copied while another is matched.
"""

import argparse
import time

import numpy as np

import kuafu
from activestereo import Mounts, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.scene_io import solids
from activestereo.scene_io.bodies import Bodies, Shape, add_mesh


def mounts(device: kuafu.Device, environments: range, count: int) -> Mounts:
    """A scene with balls in these of `count` environments, and sensors in all."""
    scene = kuafu.Scene(device)
    bodies = Bodies(scene, count)
    random = np.random.default_rng(1)
    ball, box = add_mesh(scene, solids.sphere()), add_mesh(scene, solids.box())
    paints = [
        scene.add_material(kuafu.Material(base_color=(*random.uniform(0.2, 0.9, 3), 1), metallic=float(k % 3 == 0)))
        for k in range(8)
    ]
    bodies.add("wall", [Shape(box, [paints[1]], np.diag([0.1, 3.0, 3.0, 1.0]))], environments=environments)
    for k, paint in enumerate(paints):
        size = np.diag([0.06, 0.06, 0.06, 1.0])
        bodies.add(f"ball {k}", [Shape(ball, [paint], size)], environments=environments)
    poses = np.tile([0, 0, 0, 1.0, 0, 0, 0], (count, 9, 1))
    poses[:, 0, 0] = 1.1
    poses[:, 1:, 0] = random.uniform(0.6, 0.9, (count, 8))
    poses[:, 1:, 1:3] = random.uniform(-0.3, 0.3, (count, 8, 2))
    bodies.move(poses)
    return Mounts(scene, np.tile([0, 0, 0, 1.0, 0, 0, 0], (count, 1)))


def least_ms(batch: StereoDepthSensorBatch, rounds: int) -> tuple[float, str, np.ndarray]:
    """The least time of a picture with depth; where it went; the first picture's depth."""
    found, first = [], np.empty(0)
    for n in range(rounds + 1):
        start = time.perf_counter()
        batch.take_picture(infrared_only=True)
        taken = time.perf_counter()
        batch.compute_depth()
        depth = batch.get_depth()
        end = time.perf_counter()
        kinds = [("ir", taken - start), ("depth", end - taken)]
        stages = [stage_ms(batch, kind) for kind, _ in kinds]
        beyond = [f"{1e3 * seconds - ms:.2f}" for (_, seconds), ms in zip(kinds, stages, strict=True)]
        found.append((1e3 * (end - start), f"stages {sum(stages):.2f}, beyond {' + '.join(beyond)}"))
        first = depth.copy() if n == 0 else first
    return *min(found[1:]), first


def stage_ms(batch: StereoDepthSensorBatch, kind: str) -> float:
    return sum(ms for name, ms in batch.stage_times.items() if name.startswith(kind))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--environments", type=int, default=256)
    parser.add_argument("--scales", default="0.15,0.3")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--batches", type=int, default=1)
    args = parser.parse_args()
    count = args.environments
    found = [info.index for info in kuafu.Device.enumerate() if info.usable and info.kind == "discrete gpu"]
    devices = [kuafu.Device(index) for index in found] if len(found) > 1 else [kuafu.Device(), kuafu.Device()]
    print(f"{len(devices)} x {devices[0].info.name}, {count} environments")
    for scale in map(float, args.scales.split(",")):
        config = StereoDepthSensorConfig("D435").scaled(scale)
        config.samples_per_pixel, config.max_bounces, config.ir_exposure_mode = 4, 2, "fixed"
        with StereoDepthSensorBatch(config, mounts(devices[0], range(count), count)) as one:
            one_ms, where, expected = least_ms(one, args.rounds)
        sizes = ["{}x{}".format(*size) for size in (config.ir_resolution, config.rgb_resolution)]
        rate = f"{one_ms:8.2f} ms on one ({where}), {1e3 * count / one_ms:8.0f} pairs/s"
        print(f"{sizes[0]}, depth {sizes[1]}: {rate}")
        for used in range(2 if args.batches == 1 else 1, len(devices) + 1):
            homes = [device for device in devices[:used] for _ in range(args.batches)]
            bounds = [k * count // len(homes) for k in range(len(homes) + 1)]
            own = [range(a, b) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
            parts = [mounts(device, part, count) for device, part in zip(homes, own, strict=True)]
            with StereoDepthSensorBatch(config, parts) as split:
                ms, where, depth = least_ms(split, args.rounds)
                same = "the same depths" if np.array_equal(depth, expected) else "OTHER DEPTHS"
                rate = f"{ms:8.2f} ms on {used} ({where}), {1e3 * count / ms:8.0f} pairs/s"
                print(f"    {rate}, {one_ms / ms:.2f} times; {same}")


if __name__ == "__main__":
    main()
