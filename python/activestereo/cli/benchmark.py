# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo benchmark`: measures how closely simulated depth resembles a real camera's."""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.cli import arguments as cli
from activestereo.common.input_files import read_json
from activestereo.common.progress_bar import ProgressBar
from activestereo.common.shown import counted
from activestereo.report.screen import Figure, command, screen

_MOST_BARS = 6

_TEXT = """\
Tells how well simulated depth ranks methods as a real camera's depth does, from their
scores in each world: Pearson's and Spearman's correlation over the methods and the mean
gap between scores, with 95 % intervals over the views. SCORES.csv has a header and one
line for each view, or for each score from 0 to 1:

  criterion,method,world,view,found       within 10 mm,ICP on clean,raster,7,1
  criterion,method,world,score            within 10 mm,a network,real,0.83

Depth of 'generate' with a camera's preset, and the same with another camera, are worlds.

example:
  activestereo benchmark sim-to-real scores.csv networks.csv --real lab
"""

_REALISM_TEXT = """\
How close simulated depth comes to a camera's: captures with a scene's model, as
'calibrate world' or 'calibrate scene' make them, are simulated in nine ways: clean
depth, Gaussian noise, the data sheet's, simkinect, Redwood, isaac-like, raster stereo,
a camera's preset, and the preset with the capture's own projector, pattern, black level
and light (calibrated). Holes, bias, noise, edges and the infrared pair are measured as
the device's are, with intervals over views -> DIR/realism.json, realism.html

A capture whose depth is a better instrument's is followed by = and the folder of the
device's own: 16-bit PNG files in millimetres, in order of the frames.

examples:
  activestereo benchmark realism captures/sofa captures/desk --out out/realism
  activestereo benchmark realism captures/hall=scans/hall_d415 --sensor d415 -o out/hall
"""


def add_parser(commands: cli.Commands) -> None:
    benchmarks = cli.add_command(commands, "benchmark", "measure how well simulated depth stands for real depth", "")
    kinds = benchmarks.add_subparsers(dest="benchmark", metavar="BENCHMARK", required=True)
    text = "measure how close kinds of simulated depth come to a real camera's"
    parser = cli.add_command(kinds, "realism", text, _REALISM_TEXT, _run_realism)
    text = "a capture's folder, or with =DIR the device's depth of it"
    parser.add_argument("captures", nargs="+", type=_capture, metavar="CAPTURE[=DIR]", help=text)
    cli.add_shared(parser, out=True, device=True, seed="of all noise")
    parser.add_argument("--sensor", default="d415", metavar="NAME", help="the camera's preset (default: d415)")
    text = "rays per pixel (default: 16)"
    parser.add_argument("--samples-per-pixel", type=cli.integer_from(1), default=16, metavar="N", help=text)
    cli.add_shared(parser, json=True)
    text = "measure how well simulated depth ranks methods as real depth does"
    parser = cli.add_command(kinds, "sim-to-real", text, _TEXT, _run)
    parser.add_argument("scores", type=Path, nargs="+", metavar="SCORES.csv", help="a table of scores")
    parser.add_argument("--real", default="real", metavar="WORLD", help="the world of reality (default: real)")
    cli.add_shared(parser, seed="of the resampled views", json=True, verbose="the table of all worlds, in Markdown")


def _run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.sim_to_real import agreement_table, agreements, closest, read_scores

    found = agreements(read_scores(args.scores), args.real, args.seed)
    if args.json:
        cli.print_json({key: {world: own.as_json() for world, own in worlds.items()} for key, worlds in found.items()})
        return
    sentence, best = closest(found, args.real)
    rows = sorted(
        ((w, c, own) for c, worlds in found.items() for w, own in worlds.items()), key=lambda row: row[0] != best
    )
    figures = [Figure(f"{w}, {c}", str(own.pearson), max(own.pearson.value, 0.0)) for w, c, own in rows[:_MOST_BARS]]
    notes = ["above: Pearson's correlation with the real scores over the methods, 95 %"]
    print(screen(sentence, figures, notes, details="\n".join(agreement_table(found)), verbose=args.verbose))


def _capture(text: str) -> tuple[Path, Path | None]:
    capture, _, depth = text.partition("=")
    return Path(capture), Path(depth) if depth else None


def _run_realism(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.realism import DEVICE, HOLES, board, verdicts, write_board

    cli.make_folder(args.out)
    with ProgressBar("simulating in nine ways") as bar:
        found = board(args.captures, args.sensor, args.samples_per_pixel, args.seed, args.device, bar)
    write_board(found, args.out, {"sensor": args.sensor, "samples": args.samples_per_pixel, "seed": args.seed})
    if args.json:
        cli.print_json(read_json(args.out / "realism.json"))
        return
    holes = found.rows[HOLES]
    closest = sorted((m for m in holes if m != DEVICE), key=lambda method: -holes[method].value)[:_MOST_BARS]
    figures = [Figure(f"{HOLES}, {m}", f"{holes[m].value:.2f}", holes[m].value) for m in closest]
    sentence, *notes = verdicts(found)
    first = args.captures[0][0]
    step = command("diagnose", first, *cli.carried(args, "device"), "-o", args.out / first.name)
    print(
        screen(f"{counted(len(found.views), 'view')}, {sentence}.", figures, notes, [step], args.out / "realism.html")
    )
