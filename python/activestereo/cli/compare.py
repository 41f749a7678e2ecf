# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo compare`: compares the simulator's images with a measured capture."""

import argparse
from pathlib import Path

from activestereo.capture.capture import read_capture
from activestereo.cli import arguments as cli
from activestereo.common.phases import Phases
from activestereo.common.progress_bar import ProgressBar
from activestereo.report.screen import WRITING, WRITING_S, command

_TEXT = """\
Compares the simulator with a capture: renders the scene from the capture's poses, fits
projector scale, ambient scale and black level on the train frames, and gives the root
mean square error of the infrared images and of depth, train and test, beside the noise
floor that repeated frames show, or else a frame's own pair. It looks on the train frames
where the model fails. Where the pattern, the geometry or the order of the cameras is another
one than the files say, that is the first line: nothing below it means anything then.

Writes into DIR:
  compare.json  all figures (compare.schema.json of the package activestereo.report)
  report.html   the same on one page, to explore in a browser: every frame and camera,
                measured and modelled; it needs no other file and no network. A
                diagnose.json in DIR is shown too, with what each effect leaves

CAPTURE is a folder with capture.json, the scene, the projector's pattern and the images
of both infrared cameras.

examples:
  activestereo compare captures/table --out out/compare
  activestereo compare captures/table --model out/diagnosis/model.json --out out/again
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "compare", "compare the simulator with a measured capture", _TEXT, run)
    parser.add_argument("capture", type=Path, metavar="CAPTURE", help="the capture's folder")
    cli.add_shared(parser, out=True)
    cli.add_shared(parser, model="model.json: its effects act inside of the engines (default: none)")
    cli.add_shared(parser, effects=", where the model has some", samples=True, max_bounces=True)
    cli.add_shared(parser, seed="same seed, same pictures", device=True, json=True)
    cli.add_shared(parser, verbose="errors of both splits and the fit")


def run(args: argparse.Namespace) -> None:
    cli.make_folder(args.out)
    capture = read_capture(args.capture)  # a bad capture fails before half a second of imports

    from activestereo.compare.cache import LayerCache
    from activestereo.compare.compare import PHASES, compare
    from activestereo.compare.engine_prediction import engines_of
    from activestereo.compare.mismatch import Match
    from activestereo.effects.engines import CaptureRenderer
    from activestereo.effects.engines.loaded_scene import is_measured_room
    from activestereo.model import read_model
    from activestereo.model.library import compared_under, library
    from activestereo.report.summary import comparison_screen, is_near_noise
    from activestereo.report.write import write_report

    effects = library(*args.effects)
    under_model = {} if args.model is None else compared_under(read_model(args.model, effects), args.capture)
    if args.model is not None and not is_measured_room(capture):  # in a room effects act on its images, as in diagnose
        under_model["engines"] = engines_of(args.device, args.spp, args.max_bounces, args.seed)
    with ProgressBar(f"comparing {args.capture.name}") as bar:
        phases = Phases(bar, PHASES | {WRITING: WRITING_S})
        comparison = compare(
            args.capture, renderer=CaptureRenderer(args.device), samples_per_pixel=args.spp,
            max_bounces=args.max_bounces, seed=args.seed, progress=phases, **under_model,
        )  # fmt: skip
        is_found = args.model is not None and is_near_noise(comparison.scores)
        name, folder = ("simulate", "simulated") if is_found else ("diagnose", "diagnosis")
        same = cli.carried(args, "model", "effects", *cli.SAME_RUN)
        next_step = command(name, args.capture, *same, "-o", args.out / folder)
        if Match(**comparison.scores["match"]).has_wrong_geometry:
            next_step = command("view", args.capture, *cli.carried(args, "device"))
        phases.begin(WRITING)
        write_report(comparison, args.out, effects=effects, progress=phases, steps=[next_step])
        phases.end()
    if args.json:
        cli.print_json(comparison.scores)
        return
    usage = LayerCache().usage_text()
    print(comparison_screen(comparison.scores, next_step, args.out / "report.html", usage, args.verbose))
