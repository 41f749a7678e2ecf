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
    parser = cli.add_command(kinds, "realism", text, _TEXT, _run)
    text = "a capture's folder, or with =DIR the device's depth of it"
    parser.add_argument("captures", nargs="+", type=_capture, metavar="CAPTURE[=DIR]", help=text)
    cli.add_shared(parser, out=True, device=True, seed="of all noise")
    parser.add_argument("--sensor", default="d415", metavar="NAME", help="the camera's preset (default: d415)")
    text = "rays per pixel (default: 16)"
    parser.add_argument("--samples-per-pixel", type=cli.integer_from(1), default=16, metavar="N", help=text)
    cli.add_shared(parser, json=True)


def _capture(text: str) -> tuple[Path, Path | None]:
    capture, _, depth = text.partition("=")
    return Path(capture), Path(depth) if depth else None


def _run(args: argparse.Namespace) -> None:
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
