# SPDX-License-Identifier: Apache-2.0
"""The cost of a picture and its depth for the user: wall time in Python from take_picture() to the depth as an
array.

usage: PYTHONPATH=build/python python3 tests/bench/bench_sensor.py [--size 848x480] [--rounds N] [--environments 1,16]

First table: our sensor in front of the example's table-top (102 k triangles), path depth 8, and SAPIEN's
StereoDepthSensor, where the package, CUDA and a renderer are, before twelve spheres and boxes. The least of the rounds
counts. Second table: environments of the grasping task in batches: pairs a second, and memory.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from activestereo import StereoDepthSensor, StereoDepthSensorBatch, StereoDepthSensorConfig
from activestereo.common.pose import body_pose
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD, write_table_top

sys.path.insert(0, str(Path(__file__).parents[2] / "examples/grasp_task"))
from stereo_grasp import GraspWorld

# Samples per pixel, and whether there is an RGB picture, which is read as bytes.
ROWS = ((2, False), (8, False), (32, False), (2, True), (8, True))
DEPTH = "compute_depth"

SAPIEN = """
import json, sys, time
import numpy as np, sapien
from sapien.sensor import StereoDepthSensor, StereoDepthSensorConfig
width, height, rounds = (int(a) for a in sys.argv[1:4])
r = sapien.render
r.set_camera_shader_dir("rt"); r.set_ray_tracing_path_depth(8); r.set_ray_tracing_denoiser("none")
out = {}
for spp, with_rgb in json.loads(sys.argv[4]):
    r.set_ray_tracing_samples_per_pixel(spp)
    scene = sapien.Scene(); scene.set_ambient_light([.1, .1, .1]); scene.add_point_light([0, 0, 2], [3, 3, 3])
    scene.add_ground(0)
    random = np.random.default_rng(0)
    for k in range(12):
        b = scene.create_actor_builder(); b.set_initial_pose(sapien.Pose([*random.uniform(-.3, .3, 2), .05]))
        m = r.RenderMaterial(base_color=[*random.uniform(.2, .9, 3), 1])
        b.add_sphere_visual(radius=.05, material=m) if k % 2 else b.add_box_visual(half_size=[.05] * 3, material=m)
        b.build_kinematic()
    mount = sapien.Entity(); mount.set_pose(sapien.Pose([-.7, 0, .5], [.94, 0, .34, 0])); scene.add_entity(mount)
    c = StereoDepthSensorConfig("D435"); scale = width / c.ir_resolution[0]
    for n in ("rgb", "ir"):
        k = getattr(c, n + "_intrinsic").copy(); k[:2] *= scale
        setattr(c, n + "_intrinsic", k); setattr(c, n + "_resolution", (width, height))
    s = StereoDepthSensor(c, mount); times, depths = [], []
    for _ in range(rounds + 1):
        scene.update_render(); t = time.perf_counter(); s.take_picture(infrared_only=not with_rgb)
        d = time.perf_counter(); s.compute_depth(); s.get_depth(); e = time.perf_counter()
        if with_rgb: s.get_rgb(); e = time.perf_counter()
        times.append(e - t); depths.append(e - d)
    out[f"{spp},{int(with_rgb)}"] = min(times[1:]); out["compute_depth"] = min(depths[1:])
print("TIMES " + json.dumps(out))
"""


def sapien_times(size: tuple[int, int], rounds: int) -> dict[str, float] | str:
    """{row: seconds}, or why there are none. In a process of its own: without CUDA SAPIEN's sensor ends it."""
    command = [sys.executable, "-c", SAPIEN, *map(str, (*size, rounds)), json.dumps(ROWS)]
    said = subprocess.run(command, capture_output=True, text=True)
    for line in said.stdout.splitlines():
        if line.startswith("TIMES "):
            return dict(json.loads(line.removeprefix("TIMES ")))
    lines = (said.stderr.strip() or "it ended without a word").splitlines()
    return lines[-1][:150]


def our_times(size: tuple[int, int], rounds: int, device: str, model: str) -> tuple[dict[str, float], str]:
    """{row: seconds}, and the device's name."""
    out: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table_top.gltf"
        write_table_top(path)
        config = StereoDepthSensorConfig(model).scaled(size[0] / 848)
        sensor = StereoDepthSensor(config, path, pose=body_pose(CAMERA_TO_WORLD), device=device)
        name = sensor.device.info.name
        scene = sensor.scene
        sensor.close()
        for spp, with_rgb in ROWS:
            config.samples_per_pixel, config.max_bounces = spp, 8
            with StereoDepthSensor(config, scene, pose=body_pose(CAMERA_TO_WORLD)) as sensor:
                take = picture_and_depth(sensor, with_rgb)
                out[f"{spp},{int(with_rgb)}"] = least(take, rounds)
                out[DEPTH] = min(
                    out.get(DEPTH, np.inf), least(lambda s=sensor: (s.compute_depth(), s.get_depth()), rounds)
                )
    return out, name


def picture_and_depth(sensor: StereoDepthSensor | StereoDepthSensorBatch, with_rgb: bool) -> Callable[[], object]:
    def take() -> None:
        sensor.take_picture(infrared_only=not with_rgb)
        sensor.compute_depth()
        sensor.get_depth()
        if with_rgb:
            sensor.get_rgba8()

    return take


def least(work: Callable[[], object], rounds: int) -> float:
    """Seconds of the quickest of the rounds, after one that does not count."""
    seconds = []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds[1:])


def print_batches(counts: list[int], samples: list[int], rounds: int, device: str) -> None:
    print("\n| environments, infrared pairs 128x128 | spp | pairs/s | memory, MB |\n|--|--|--|--|")
    for count in counts:
        for spp in samples:
            world = GraspWorld(count, "full", size_px=64, samples_per_pixel=spp, device=device)
            world.reset(seed=1)
            rest = np.zeros((count, 4))
            seconds = least(lambda w=world, a=rest: (w.step(a), w.look()), rounds)
            memory = world.camera.sensors.allocated_bytes / 1e6
            print(f"| {count} | {spp} | {count / seconds:.0f} | {memory:.0f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="848x480", help="of all images; a D435's fields of view")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--device", default="auto")
    parser.add_argument("--model", default="sapien-D435", help="our sensor's preset")
    parser.add_argument("--environments", default="1,16", help="of the second table; empty for none")
    parser.add_argument("--samples", default="1,4", help="of the second table")
    args = parser.parse_args()
    width, height = (int(n) for n in args.size.split("x"))
    ours, name = our_times((width, height), args.rounds, args.device, args.model)
    theirs = sapien_times((width, height), args.rounds)
    print(f"{name}, {width}x{height}, {args.model}, wall milliseconds, least of {args.rounds}")
    print("\n| | ours | SAPIEN StereoDepthSensor | SAPIEN / ours |\n|--|--|--|--|")
    rows = {f"{spp},{int(rgb)}": f"{spp} spp, {'RGB + ' if rgb else ''}IR + depth" for spp, rgb in ROWS}
    for key, title in (rows | {DEPTH: DEPTH}).items():
        other = theirs.get(key) if isinstance(theirs, dict) else None
        shown = "not here | " if other is None else f"{1e3 * other:.1f} | {other / ours[key]:.1f}"
        print(f"| {title} | {1e3 * ours[key]:.1f} | {shown} |")
    if isinstance(theirs, str):
        print(f"\nSAPIEN: {theirs}")
    if args.environments:
        counts, samples = ([int(n) for n in text.split(",")] for text in (args.environments, args.samples))
        print_batches(counts, samples, args.rounds, args.device)


if __name__ == "__main__":
    main()
