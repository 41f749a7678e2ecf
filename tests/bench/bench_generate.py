#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Processor seconds of a frame of 'activestereo generate': three small things, RGB of 640x480, a D435, 16 samples.

    PYTHONPATH=build/python /usr/bin/python3 tests/bench/bench_generate.py [--count N]
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter

SHAPES = {"ball": meshes.sphere(0.05), "box": meshes.box(0.08, 0.12, 0.06), "ring": meshes.torus(0.05, 0.02)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4, help="frames (default: 4)")
    count = parser.parse_args().count
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for name, shape in SHAPES.items():
            writer = GltfWriter(name)
            writer.add_mesh(name, shape, writer.add_material("paint"))
            files.append(Path(folder) / f"{name}.glb")
            writer.write(files[-1])
        command = [sys.executable, "-m", "activestereo", "generate", *map(str, files), "--device", "cpu"]
        subprocess.run([*command, "--count", str(count), "--out", f"{folder}/set"], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{(used.ru_utime + used.ru_stime) / count:.1f} processor seconds a frame, n = {count}")


if __name__ == "__main__":
    main()
