# SPDX-License-Identifier: Apache-2.0
"""The cost of five engine effects for a sensor: time of picture and depth under a model over the time without one.

Both take turns, and the least of the rounds counts for each. usage: PYTHONPATH=build/python python3
tests/bench/bench_model_sensor.py [--rounds N]
"""

import argparse
import tempfile
import time
from pathlib import Path

from activestereo import StereoDepthSensor, StereoDepthSensorConfig
from activestereo.effects import builtin
from activestereo.common.pose import body_pose
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD, write_table_top
from activestereo.model import Quantity, SensorModel

EFFECTS = ("vignetting", "lens_psf", "principal_point_offset", "projector_vignetting", "shot_noise")


def five_effects() -> SensorModel:
    model, known = SensorModel(), builtin()
    for name in EFFECTS:
        model = model.with_effect(known[name], {n: Quantity(v) for n, v in known[name].typical_values.items()})
    return model


def frame_s(sensor: StereoDepthSensor) -> float:
    start = time.perf_counter()
    sensor.take_picture(infrared_only=True)
    sensor.compute_depth()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--scale", type=float, default=0.5, help="of a D435's images")
    parser.add_argument("--device", default="auto")
    args = parser.parse_args()
    config = StereoDepthSensorConfig("D435").scaled(args.scale)
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "table_top.gltf"
        write_table_top(scene)
        sensors = {
            "without a model": StereoDepthSensor(config, scene, pose=body_pose(CAMERA_TO_WORLD), device=args.device),
            "with five effects": StereoDepthSensor(
                config, scene, pose=body_pose(CAMERA_TO_WORLD), device=args.device, model=five_effects()
            ),
        }
        least = dict.fromkeys(sensors, float("inf"))
        for turn in range(args.rounds + 1):
            for name, sensor in sensors.items():
                seconds = frame_s(sensor)
                least[name] = min(least[name], seconds) if turn else least[name]
    first, second = least.values()
    print(
        f"{next(iter(sensors.values())).device.info.name}, {config.ir_resolution[0]}x{config.ir_resolution[1]}, "
        f"{config.samples_per_pixel} samples: {', '.join(EFFECTS)}"
    )
    for name, seconds in least.items():
        print(f"{name:20} {1000 * seconds:8.1f} ms")
    print(f"ratio {second / first:.3f}")


if __name__ == "__main__":
    main()
