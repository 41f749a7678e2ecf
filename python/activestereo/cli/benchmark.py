# SPDX-License-Identifier: Apache-2.0
"""activestereo benchmark sim-to-real run | score | ablate: how well simulated depth ranks methods as a foreign world
does. activestereo benchmark inject, realism: in files of their own."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from activestereo.benchmarks.sim_to_real.worlds import FOREIGN
from activestereo.cli.arguments import CommandError, Commands, add_shared, integer_from, make_folder, print_json
from activestereo.cli.benchmark_inject import add_inject
from activestereo.cli.benchmark_realism import add_realism
from activestereo.common.input_files import read_json

_TEXT = """\
Asks whether a simulated depth camera tells which methods will do well with another
camera. Three methods find poses of eight objects, from clay to glass: ICP, point
pair features, and templates with RANSAC. Each is tuned on depth of three kinds
(clean, raster, full), which makes nine models. All are scored in each of these
worlds and in a foreign one, whose camera, room and materials differ in ways that
the others are not told of.

  run     pictures, tuning, poses, scores -> DIR/gap.json, gap.md, gap.png
  score   the scores again, of what a run has so far
  ablate  rays, denoiser, noise, materials -> DIR/ablation.json, .md, .png

activestereo benchmark sim-to-real run --help tells more.
"""

_RUN = """\
Everything depends on the seed and the options alone. A run that was ended, however
it was, goes on when it is started again; with a larger --views it adds views.

examples:
  activestereo benchmark sim-to-real run --views 80 --out out/gap
  activestereo benchmark sim-to-real run --views 320 --workers 2 --out out/gap
  activestereo benchmark sim-to-real run --foreign mitsuba --workers 2 --out out/mitsuba
"""

_ABLATE = """\
Takes the first views of a run again in worlds like 'full': with 2 to 128 rays per
pixel with and without the denoiser, with 0 to 10 times the sensor's noise, with
materials drawn at random, and with --measured with measured ones. The models stay
those of the run.

examples:
  activestereo benchmark sim-to-real ablate out/gap
  activestereo benchmark sim-to-real ablate out/gap --only noise --views 160
"""


def add_parser(commands: Commands) -> None:
    text = "measure how well simulated depth stands for real depth, and how well the lab finds a known effect"
    benchmarks = commands.add_parser("benchmark", help=text)
    kinds = benchmarks.add_subparsers(dest="benchmark", metavar="BENCHMARK", required=True)
    add_inject(kinds)
    add_realism(kinds)
    text = "measure how well simulated depth ranks methods as a foreign world does"
    parser = kinds.add_parser("sim-to-real", help=text, description=_TEXT)
    parts = parser.add_subparsers(dest="part", metavar="PART", required=True)
    make = parts.add_parser("run", help="pictures, tuning, poses, scores", description=_RUN)
    add_shared(make, out=True, device=True, seed="of everything that is drawn; same seed, same scores")
    text = "test views, in whole rounds of eight (default: 320)"
    make.add_argument("--views", type=integer_from(8), default=320, metavar="N", help=text)
    text = "views that methods are tuned on (default: 64)"
    make.add_argument("--tuning-views", type=integer_from(8), default=64, metavar="N", help=text)
    make.add_argument("--sensor", default="d435", metavar="NAME", help="as simulate's (default: d435)")
    text = "rays per pixel of raster and full (default: 16)"
    make.add_argument("--samples-per-pixel", type=integer_from(1), default=16, metavar="N", help=text)
    text = "rays per pixel of the foreign world (default: 64)"
    make.add_argument("--foreign-samples", type=integer_from(1), default=64, metavar="N", help=text)
    text = "what stands for reality: a sensor unlike ours in our renderer, or Mitsuba 3, another project's renderer "
    text += "and materials (needs: pip install mitsuba) (default: sensor)"
    make.add_argument("--foreign", choices=FOREIGN, default="sensor", help=text)
    text = (
        "model.json whose imager, which 'calibrate noise' found, the sensor of raster and full has (default: its own)"
    )
    make.add_argument("--imager", type=Path, metavar="FILE", help=text)
    _add_workers(make)
    add_shared(make, json=True)
    make.set_defaults(run=_run)
    score = parts.add_parser("score", help="the scores of what a run has so far")
    score.add_argument("folder", type=Path, metavar="DIR", help="folder of a run")
    text = "scores of more models, learned ones for instance: a table with the columns method,tuned_on,world,mm,deg "
    text += "and then view,found or score (benchmarks/sim_to_real/README.md); may be given again"
    score.add_argument("--add", type=Path, action="append", default=[], metavar="FILE.csv", help=text)
    add_shared(score, json=True)
    score.set_defaults(run=_score)
    text = "rays, denoiser, noise, materials"
    ablation = parts.add_parser("ablate", help=text, description=_ABLATE)
    ablation.add_argument("folder", type=Path, metavar="DIR", help="folder of a run")
    text = "how many of the run's test views (default: 80)"
    ablation.add_argument("--views", type=integer_from(8), default=80, metavar="N", help=text)
    text = "rays per pixel to try (default: 2 4 8 16 32 64 128)"
    ablation.add_argument("--samples-per-pixel", type=integer_from(1), nargs="+", metavar="N", help=text)
    text = "only this; may be given again (default: all)"
    ablation.add_argument("--only", choices=("samples", "noise", "materials"), action="append", help=text)
    text = "model.json whose materials, which 'calibrate materials' found, are called as the objects are"
    ablation.add_argument("--measured", type=Path, metavar="FILE", help=text)
    add_shared(ablation, device=True)
    _add_workers(ablation)
    add_shared(ablation, json=True)
    ablation.set_defaults(run=_ablate)


def _add_workers(parser: argparse.ArgumentParser) -> None:
    text = "processes that find poses, and render with Mitsuba (default: 1)"
    parser.add_argument("--workers", type=integer_from(1), default=1, metavar="K", help=text)


def _run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.sim_to_real.measured_materials import read_imager
    from activestereo.benchmarks.sim_to_real.run import run
    from activestereo.benchmarks.sim_to_real.settings import BenchmarkSettings
    from activestereo.benchmarks.sim_to_real.stage import CameraSettings
    from activestereo.common.progress_bar import ProgressBar

    imager = None if args.imager is None else read_imager(args.imager)
    camera = CameraSettings(args.sensor, samples=args.samples_per_pixel, imager=imager)
    settings = BenchmarkSettings(args.views, args.tuning_views, args.seed, camera, args.foreign, args.foreign_samples)
    make_folder(args.out)
    with ProgressBar(f"{settings.rounds('test') * 8} views of 4 worlds") as bar:
        run(settings, args.out, args.device, args.workers, bar)
    _write(args.out, args.json)


def _score(args: argparse.Namespace) -> None:
    _write(args.folder, args.json, args.add)


def _write(out: Path, as_json: bool, added: Sequence[Path] = ()) -> None:
    from activestereo.benchmarks.sim_to_real.files import RunFolder
    from activestereo.benchmarks.sim_to_real.report import agreement_table, results, write_report

    found = results(RunFolder(out), added)
    write_report(found, out)
    if as_json:
        print_json(read_json(out / "gap.json"))
        return
    print("\n".join(agreement_table(found)))
    print(f"{found.views} views; written: {out / 'gap.json'}, gap.md, gap.png")


def _ablate(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.sim_to_real.ablate import KINDS, SAMPLES, ablate, table, variants, write_ablation
    from activestereo.benchmarks.sim_to_real.files import RunFolder
    from activestereo.benchmarks.sim_to_real.measured_materials import read_measured
    from activestereo.benchmarks.sim_to_real.objects import objects
    from activestereo.common.progress_bar import ProgressBar

    kinds, measured = tuple(args.only or KINDS), None
    if args.measured is not None:
        if "materials" not in kinds:
            raise CommandError("--measured is a variant of the materials, which --only leaves out")
        measured = read_measured(args.measured, objects())
    worlds = variants(kinds, tuple(args.samples_per_pixel or SAMPLES), measured is not None)
    with ProgressBar(f"{args.views} views of {len(worlds)} worlds") as bar:
        found = ablate(RunFolder(args.folder), args.views, worlds, args.device, args.workers, bar, measured)
    write_ablation(found, args.folder)
    if args.json:
        print_json(read_json(args.folder / "ablation.json"))
        return
    print("\n".join(table(found)))
    print(f"written: {args.folder / 'ablation.json'}, ablation.md, ablation.png")
