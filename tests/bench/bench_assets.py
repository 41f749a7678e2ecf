# SPDX-License-Identifier: Apache-2.0
"""Loads a folder of models: each file is loaded and rendered small, in a process and a time limit of its own.

Prints a table: file, verdict (rendered, refused, nothing to see, stopped, crashed), milliseconds, and the messages or
the line that refuses it. usage: PYTHONPATH=build/python python3 tests/bench/bench_assets.py FOLDER [--limit SECONDS]
"""

import argparse
import json
import logging
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import kuafu
from activestereo.common.pose import look_at
from activestereo.scene_io import OWN_ENDINGS


class Kept(logging.Handler):
    """Keeps the messages of the library."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.lines = []

    def emit(self, record):
        self.lines.append(record.getMessage())


def camera_before(low, high):
    """Sees the box from a corner of the room."""
    middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-6)
    forward = np.array([-0.5, -0.35, -0.8]) / np.linalg.norm([-0.5, -0.35, -0.8])
    pose = look_at(middle - forward * 3 * radius, middle, (0, 1, 0))
    k = [[150, 0, 39.5], [0, 150, 29.5], [0, 0, 1]]
    return kuafu.Camera(80, 60, k, pose, near_m=1e-3 * radius, far_m=1e3 * radius)


def judge(path):
    """{"verdict", "ms", "messages"} of one file, in this process."""
    kept = Kept()
    logging.getLogger("kuafu").addHandler(kept)
    device = kuafu.Device()
    scene, started = kuafu.Scene(device), time.perf_counter()
    try:
        scene.load(path)
        low, high = np.asarray(scene.summary.bounds_min_m), np.asarray(scene.summary.bounds_max_m)
        if not np.all(np.isfinite(high - low)):
            return {"verdict": "nothing to see", "ms": 0, "messages": kept.lines}
        scene.set_environment((1.0, 1.0, 1.0))
        view = camera_before(low, high)
        renderer = kuafu.Renderer(device)
        outputs = renderer.render(scene, view, ["radiance", "depth"], band="visible", spp=4, max_bounces=6)
    except (kuafu.Error, OSError, ValueError) as error:
        return {"verdict": "refused", "ms": 0, "messages": [*kept.lines, str(error)]}
    seen = float(np.mean(np.asarray(outputs["depth"]) > 0))
    finite = bool(np.all(np.isfinite(np.asarray(outputs["radiance"]))))
    verdict = "not finite" if not finite else "rendered" if seen > 0.01 else "nothing to see"
    return {"verdict": verdict, "ms": 1e3 * (time.perf_counter() - started), "messages": kept.lines}


def judge_apart(path, limit_s):
    """judge() in a process of its own."""
    try:
        done = subprocess.run(
            [sys.executable, __file__, str(path), "--one"], capture_output=True, text=True, timeout=limit_s
        )
    except subprocess.TimeoutExpired:
        return {"verdict": "stopped", "ms": 1e3 * limit_s, "messages": []}
    if done.returncode != 0:
        return {"verdict": "crashed", "ms": 0, "messages": done.stderr.splitlines()[-1:]}
    return json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--limit", type=float, default=30.0, help="seconds for each file")
    parser.add_argument("--one", action="store_true", help="the folder is a file: judge it here, and print JSON")
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(judge(arguments.folder)))
        return
    print("| file | verdict | ms | messages |\n|--|--|--|--|")
    for path in sorted(p for p in arguments.folder.rglob("*") if p.suffix.lower() in OWN_ENDINGS):
        row = judge_apart(path, arguments.limit)
        text = "; ".join(row["messages"]).replace("|", "\\|").replace(str(arguments.folder), "")
        print(f"| {path.relative_to(arguments.folder)} | {row['verdict']} | {row['ms']:.0f} | {text} |", flush=True)


if __name__ == "__main__":
    main()
