# SPDX-License-Identifier: Apache-2.0
"""Seconds from a slider of `activestereo view` to the draft with its depth, as the server answers: of the camera, of a
surface and of each effect, at 424x240.

usage: PYTHONPATH=build/python taskset -c 0,1 python3 tests/bench/bench_view.py [--moves N] [--scene FILE] [EFFECT ...]
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import kuafu
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.cli.simulate import resized
from activestereo.effects import builtin
from activestereo.report.view.library import Library
from activestereo.report.view.routes import Routes
from activestereo.report.view.scene_source import SceneSource
from activestereo.report.view.sliders import effect_sliders
from activestereo.scene_io.example_scene import write_table_top

SIZE = 424, 240


def moved(name: str, share: float, surface: str) -> dict[str, Any]:
    """The settings under which a slider stands at this share of its length: of an effect, its first parameter's."""
    if name == "gain":
        return {"gain": 0.5 + share}
    if name == "laser power":
        return {"laser_power_mw": 360.0 * share}
    if name == "roughness":
        return {"materials": {surface: {"roughness": share}}}
    first, *others = effect_sliders(builtin()[name])
    values = {first.name: first.low + share * (first.high - first.low)} | {s.name: s.value for s in others}
    return {"effects": {name: values}}


def draft_s(routes: Routes, settings: dict[str, Any], number: int = 0) -> tuple[float, float]:
    """(wall, processor) seconds of one draft, for a page of this number."""
    call = {"entry": ".", "frame": 0, "is_draft": True, "page": number, "serial": 0, "settings": settings}
    begin, spent = time.perf_counter(), time.process_time()
    routes.simulate(call)
    return time.perf_counter() - begin, time.process_time() - spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="EFFECT")
    parser.add_argument("--moves", type=int, default=8)
    parser.add_argument("--scene", type=Path, help="default: the example's table")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = args.scene or Path(folder) / "table_top.gltf"
        if args.scene is None:
            write_table_top(scene)
        source = SceneSource(scene, kuafu.Device("cpu"), resized(StereoDepthSensorConfig("D435"), SIZE))
        routes = Routes(Library(scene, lambda _: source), builtin(), Path("model.json"))
        surface = source.simulation().material_names()[0]
        draft_s(routes, {})
        for name in args.names or ["gain", "laser power", "roughness", *builtin()]:
            shares = [(move + 0.5) / args.moves for move in range(args.moves)]
            found = [draft_s(routes, moved(name, share, surface), n) for n, share in enumerate(shares)]
            wall, processor = zip(*found, strict=True)
            median = sorted(wall)[len(wall) // 2]
            print(f"{name:26} {median:.2f} s, at most {max(wall):.2f}; processor {max(processor):.2f}", flush=True)


if __name__ == "__main__":
    main()
