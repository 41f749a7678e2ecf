# SPDX-License-Identifier: Apache-2.0
"""activestereo benchmark realism: kinds of simulated depth beside a real camera's on its own recordings."""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.cli.arguments import (
    Commands,
    add_shared,
    integer_from,
    make_folder,
    print_json,
)
from activestereo.common.input_files import read_json

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


def add_realism(kinds: Commands) -> None:
    parser = kinds.add_parser(
        "realism",
        help="measure how close kinds of simulated depth come to a real camera's",
        description=_TEXT,
    )
    text = "a capture's folder, or with =DIR the device's depth of it"
    parser.add_argument("captures", nargs="+", type=_capture, metavar="CAPTURE[=DIR]", help=text)
    add_shared(parser, out=True, device=True, seed="of all noise")
    parser.add_argument("--sensor", default="d415", metavar="NAME", help="the camera's preset (default: d415)")
    text = "rays per pixel (default: 16)"
    parser.add_argument("--samples-per-pixel", type=integer_from(1), default=16, metavar="N", help=text)
    add_shared(parser, json=True)
    parser.set_defaults(run=_run)


def _capture(text: str) -> tuple[Path, Path | None]:
    capture, _, depth = text.partition("=")
    return Path(capture), Path(depth) if depth else None


def _run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.realism.board import board, verdicts, write_board
    from activestereo.common.progress_bar import ProgressBar

    make_folder(args.out)
    with ProgressBar(f"{len(args.captures)} captures in nine ways") as bar:
        found = board(args.captures, args.sensor, args.samples_per_pixel, args.seed, args.device, bar)
    write_board(found, args.out, {"sensor": args.sensor, "samples": args.samples_per_pixel, "seed": args.seed})
    if args.json:
        print_json(read_json(args.out / "realism.json"))
        return
    print("\n".join(verdicts(found)))
    print(f"{len(found.views)} views; written: {args.out / 'realism.json'}, realism.html")
