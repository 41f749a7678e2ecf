# SPDX-License-Identifier: Apache-2.0
"""Asks whether a simulated depth camera tells which methods do well with another camera (sim_to_real/README.md).

    PYTHONPATH=build/python python3 tests/bench/bench_sim_to_real.py run out/gap --views 320 --workers 2
    PYTHONPATH=build/python python3 tests/bench/bench_sim_to_real.py run out/mitsuba --foreign mitsuba --workers 2

run: pictures, tuning, poses, scores -> DIR/gap.json, gap.md, gap.png, scores.csv. A run that was ended goes on when it
is started again; with a larger --views it adds views. score: the scores of what a run has so far."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from activestereo.cli.arguments import make_folder
from activestereo.common.progress_bar import ProgressBar
from sim_to_real.files import RunFolder
from sim_to_real.report import results, write_report
from sim_to_real.run import run
from sim_to_real.settings import BenchmarkSettings
from sim_to_real.stage import CameraSettings
from sim_to_real.worlds import FOREIGN


def score_run(folder: Path) -> None:
    print("\n".join(write_report(results(RunFolder(folder)), folder)))


def run_all(args: argparse.Namespace) -> None:
    camera = CameraSettings(args.sensor, samples=args.samples_per_pixel)
    settings = BenchmarkSettings(args.views, args.tuning_views, args.seed, camera, args.foreign, args.foreign_samples)
    make_folder(args.folder)
    with ProgressBar(f"{settings.rounds('test') * 8} views of 4 worlds") as bar:
        run(settings, args.folder, args.device, args.workers, bar)
    score_run(args.folder)


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = parser.add_subparsers(required=True)
    own, scored = parts.add_parser("run"), parts.add_parser("score")
    for part, does in ((own, run_all), (scored, lambda args: score_run(args.folder))):
        part.add_argument("folder", type=Path, metavar="DIR", help="folder of the run")
        part.set_defaults(part=does)
    own.add_argument("--views", type=int, default=320, help="test views, by eights")
    own.add_argument("--device", default="auto")
    own.add_argument("--workers", type=int, default=1, help="processes that find poses, and render with Mitsuba")
    own.add_argument("--tuning-views", type=int, default=64)
    own.add_argument("--sensor", default="d435")
    own.add_argument("--seed", type=int, default=0)
    own.add_argument("--samples-per-pixel", type=int, default=16, help="of raster and full")
    own.add_argument("--foreign-samples", type=int, default=64)
    own.add_argument("--foreign", choices=FOREIGN, default="sensor", help="a sensor of ours, or Mitsuba 3")
    args = parser.parse_args(words)
    args.part(args)


if __name__ == "__main__":
    main()
