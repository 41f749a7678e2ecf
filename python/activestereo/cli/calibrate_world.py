# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo calibrate world` and its single steps: a recording with depth becomes a capture for the
lab."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from activestereo.cli.arguments import CommandError, add_shared, carried, integer_from, print_json
from activestereo.common.input_files import read_json_object

_WORLD = """\
A camera and a room from views with depth, without wall, rig or repeats: camera, poses,
dots, exposures and albedo, each with 90 % intervals and a picture in CAPTURE/measured.

RECORDING is a capture that 'activestereo import' made: two or more pairs of one device,
dots on, each with depth in the left camera's pixels (the device's own or a laser's).
Views that overlap make the scene; all others tell of pattern and camera, too. Record a
static room, turn the camera by 10 to 30 degrees between views, keep a third of the
picture, and leave exposure where no dot is white. --test holds views out whole: of them
only pose and exposure are measured. --keep leaves what you know better as it is.

example:
  activestereo import views/ --sensor d415 --k 899.5,899.5,639.5,359.5 \\
      --baseline 0.055 --depth laser --depth-scale 0.001 -o rec
  activestereo calibrate world rec --test 2 -o capture
  activestereo compare capture
  activestereo diagnose capture
"""
_STEPS = {
    "camera": "focal length, centre, baseline and rows from overlapping views, or a board that stands in them",
    "poses": "where overlapping views were taken from, by their depth",
    "dots": "the projector's dots and place from any scenes with depth",
    "exposure": "each frame's exposure, the black level and the lens's falloff from views of known poses",
    "albedo": "the scene: surfaces under their albedo and the room's light, from views of known poses and exposures",
}
_STEP_OF = {"dots": "pattern"}


def add_parts(parts: argparse._SubParsersAction) -> None:
    """Adds the parsers of `calibrate world` and of its steps, one subcommand for each."""
    world = parts.add_parser("world", help="a camera and a room from views with depth", description=_WORLD)
    _add_arguments(world, needs_out=False)
    text = "print what it tells, from which size, and what to record for all else; RECORDING: calibrate world's capture"
    world.add_argument("--plan", action="store_true", help=text)
    text = "a step whose part of the capture stays as it is; repeatable"
    world.add_argument("--keep", choices=tuple(_STEPS)[:-1], action="append", default=[], help=text)
    world.set_defaults(run=_run_world, steps=None)
    for name, summary in _STEPS.items():
        text = f"One step of calibrate world: {summary}.\nThe rest of the capture stays as it is."
        step = parts.add_parser(name, help=summary, description=text)
        _add_arguments(step)
        step.set_defaults(run=_run, steps=(_STEP_OF.get(name, name),), keep=[])


def _add_arguments(parser: argparse.ArgumentParser, needs_out: bool = True) -> None:
    add = parser.add_argument
    add("recording", type=Path, metavar="RECORDING", help="capture of views with depth")
    add("-o", "--out", required=needs_out, type=Path, metavar="DIR", help="the new capture, which must not exist")
    add("--test", type=integer_from(0), action="append", default=[], metavar="ID", help="frame to hold out; repeatable")
    add_shared(parser, seed="same seed, same result", json=True, verbose="all steps")


def _run_world(args: argparse.Namespace) -> None:
    if args.plan:
        _print_plan(args)
    elif args.out is None:
        raise CommandError("-o is missing: the folder of the new capture")
    else:
        _run(args)


def _print_plan(args: argparse.Namespace) -> None:
    from activestereo.calibrate.world.cells import Room
    from activestereo.capture.capture import read_capture
    from activestereo.diagnose.room.names import score_room
    from activestereo.diagnose.room.plan import plan_of, plan_text
    from activestereo.effects import builtin
    from activestereo.effects.core.room_light import is_measured_room

    capture = read_capture(args.recording)
    if not is_measured_room(capture):
        raise CommandError(f"{args.recording}: is no measured room: make one with calibrate world")
    plan = plan_of(score_room(Room(capture), tuple(builtin().values())))
    if args.json:
        print_json([asdict(r) for r in plan])
    else:
        print(plan_text(plan))


def _run(args: argparse.Namespace) -> None:
    from activestereo.calibrate.world.world import STEPS, calibrate_world
    from activestereo.common.progress_bar import ProgressBar
    from activestereo.report.screen import command, screen

    if args.out.exists():
        raise CommandError(f"{args.out} exists already: a calibration writes a new folder")
    kept = {_STEP_OF.get(name, name) for name in args.keep}
    steps = args.steps or tuple(step for step in STEPS if step not in kept)
    with ProgressBar(f"measuring {args.recording.name}") as bar:
        lines = calibrate_world(args.recording, args.out, steps, args.test, args.seed, bar)
    if args.json:
        print_json(read_json_object(args.out / "capture.json")["measured"])
        return
    sentence = f"{args.out}: {', '.join(steps)} measured, each with a picture."
    same = args.out, *carried(args, "seed")
    leads = [command(name, *same, "-o", f"{args.out}_{name}") for name in ("diagnose", "compare")]
    notes = [note for line in lines for note in line.splitlines()]
    print(screen(sentence, (), notes, leads, args.out / "measured", verbose=args.verbose))
