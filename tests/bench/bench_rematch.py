# SPDX-License-Identifier: Apache-2.0
"""How fast 'activestereo depth RECORDING' matches, beside OpenCV's SGBM HH4, in one run: the same noise-textured pairs
of 848x480 with 128 disparities, each matcher in turn with every pair, the median of the rounds.

    PYTHONPATH=build/python python3 tests/bench/bench_rematch.py [--rounds 9]
"""

import argparse
import time

import cv2
import numpy as np
from bench_pairs import HH4, sgbm

import simsense
from activestereo.camera.advanced_mode import AdvancedSettings
from activestereo.camera.advanced_mode.matcher import PairMatcher
from activestereo.camera.plan import matcher_parameters
from activestereo.camera.presets import StereoDepthSensorConfig

WIDTH, HEIGHT, DISPARITIES = 848, 480, 128


def pair(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A wall with a box before it, of random texture."""
    wall = cv2.GaussianBlur(np.random.default_rng(seed).integers(0, 256, (HEIGHT, WIDTH + 64), np.uint8), (3, 3), 0)
    left, right = wall[:, 64:].copy(), wall[:, 40:-24].copy()
    right[120:360, 200:500] = left[120:360, 260:560]
    return left, np.ascontiguousarray(right)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds
    pairs, K = [pair(seed) for seed in range(3)], np.array([[427.0, 0, 423.5], [0, 427.0, 239.5], [0, 0, 1]])
    matchers = {"OpenCV SGBM HH4, block 7": lambda left, right: sgbm(HH4, 7)(left, right, DISPARITIES)}
    for name in ("D415", "D435"):
        base = matcher_parameters(StereoDepthSensorConfig(name))
        given = PairMatcher((K, K), 0.05, pairs[0][0], AdvancedSettings({}), base, {}, simsense.Device("host"))
        matchers[f"depth RECORDING --sensor {name.lower()}"] = given.image
    times: dict[str, list[float]] = {name: [] for name in matchers}
    for number in range(rounds + 1):
        for name, match in matchers.items():
            start = time.perf_counter()
            for left, right in pairs:
                match(left, right)
            if number:  # the first round warms up
                times[name].append((time.perf_counter() - start) / len(pairs))
    reference = np.median(times["OpenCV SGBM HH4, block 7"])
    for name, taken in times.items():
        print(f"{name:32s} {1e3 * np.median(taken):7.1f} ms a pair, {np.median(taken) / reference:.2f} of HH4's time")


if __name__ == "__main__":
    main()
