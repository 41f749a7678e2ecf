# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo diagnose`: finds which physical effect the model of a capture lacks."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from activestereo.cli import arguments as cli
from activestereo.common.output_files import write_text
from activestereo.common.phases import Phases
from activestereo.common.progress_bar import ProgressBar
from activestereo.report.screen import WRITING, WRITING_S, Step, command

if TYPE_CHECKING:
    from activestereo.diagnose import Diagnosis

_TEXT = """\
Finds out which physical effects the model of a capture lacks. Every effect of the
library is scored on the train frames beside projector scale, ambient scale, black
level, albedos and the rig's geometry; the likeliest few are fitted, and the best is
named. Then noise, weights and geometry are measured again beside it, and the search
goes on until nothing passes: a name is no chance among all effects (--alpha 0.01)
and removes 0.05 of the squared error above the noise or more (--least-share).
Temporal noise is judged on repeats, the depth engine on the device's disparity. Test
frames serve once, for the held-out figures, which are those of compare; without test
frames they are of frames left out in turn.

The verdict is one of
  effect        what was added explains most of the error above the noise floor
  none          the model is at the noise floor
  unknown       something is missing that no effect of the library explains: the
                model of the residual is printed, and effect_stub.py is for you to edit
  undetermined  the data cannot tell; what to measure next is printed

Writes into DIR:
  report.html    the verdict on its first screen, then pictures to explore, a slider of the
                 strength of what was found, the ranking and where the model fails, on one
                 page that needs no other file
  diagnose.json  verdict, ranking, sets of what cannot be told apart, held-out figures
  model.json     the model with what was added: compare --model, diagnose --model
Ctrl-C leaves stopped.txt in place of these; the same command then goes on where it was.

examples:
  activestereo diagnose captures/table --out out/diagnosis
  activestereo diagnose captures/table --effects mine.py --out out/2

Every number that decides: numbers.py of the package activestereo.diagnose.
"""


_STOPPED = "stopped.txt"


def add_parser(commands: cli.Commands) -> None:
    text = "rank which physical effect is missing from a capture's model"
    parser = cli.add_command(commands, "diagnose", text, _TEXT, run)
    parser.add_argument("capture", type=Path, metavar="CAPTURE", help="the capture's folder")
    cli.add_shared(parser, out=True)
    cli.add_shared(parser, model="model.json to start from (default: no effects)")
    text = "a room of calibrate world of the same unit when it was good, best of the same views; repeatable"
    parser.add_argument("--reference", type=Path, metavar="CAPTURE", action="append", default=[], help=text)
    cli.add_shared(parser, effects=", ranked beside the built-in ones")
    text = "do not fit what surfaces, air and lights do to kuafu's own images, which saves their renders"
    parser.add_argument("--no-refine", dest="refine", action="store_false", help=text)
    parser.add_argument("--alpha", type=cli.positive_share, metavar="P", help="probability of a name by chance")
    text = "least share of the squared error above the noise (of depth: of the disparity's error) that a name removes"
    parser.add_argument("--least-share", type=cli.share, metavar="SHARE", help=text)
    text = "search in images averaged over NxN pixels (default: 1 up to 480x270, more for larger images)"
    parser.add_argument("--bin", type=cli.integer_from(1), metavar="N", help=text)
    cli.add_shared(parser, samples=" of what is told, as of compare; the search takes half")
    cli.add_shared(parser, max_bounces=True, seed="same seed, same answer")
    text = "processes that fit (default: one per core)"
    parser.add_argument("--workers", type=cli.integer_from(1), metavar="N", help=text)
    cli.add_shared(parser, device=True, json=True)
    cli.add_shared(parser, verbose="the ranking, the depth's error, times")


def run(args: argparse.Namespace) -> None:
    from activestereo.compare.cache import LayerCache
    from activestereo.compare.engine_prediction import engine_changes, engines_of
    from activestereo.diagnose import diagnose
    from activestereo.diagnose.numbers import NUMBERS
    from activestereo.diagnose.settings import PHASES
    from activestereo.effects.engines import CaptureRenderer
    from activestereo.model import read_model
    from activestereo.model.library import library

    cli.make_folder(args.out)
    effects = library(*args.effects)
    given = {name: getattr(args, name) for name in ("alpha", "least_share") if getattr(args, name) is not None}
    model = None if args.model is None else read_model(args.model, effects)
    sampled = args.device, args.spp, args.max_bounces, args.seed
    with ProgressBar(f"diagnosing {args.capture.name}") as bar, _told_where_stopped(args.out, bar):
        phases = Phases(bar, PHASES | {WRITING: WRITING_S})
        diagnosis = diagnose(
            args.capture, model=model, effects=effects, renderer=CaptureRenderer(args.device),
            samples_per_pixel=args.spp, max_bounces=args.max_bounces, seed=args.seed,
            workers=args.workers or os.cpu_count() or 1, progress=phases, numbers=replace(NUMBERS, **given),
            rendering=(lambda capture: engine_changes(capture, *sampled)) if args.refine else None,
            engines=engines_of(*sampled), binning=args.bin, reference=args.reference, says=bar.tell,
        )  # fmt: skip
        phases.begin(WRITING)
        # The verdict does not wait for Matplotlib, which takes seconds at its first start.
        from activestereo.report.diagnosis import diagnosis_screen
        from activestereo.report.write import write_diagnosis, write_diagnosis_report

        steps = _steps(args, diagnosis)
        write_diagnosis_report(diagnosis, args.out, effects, phases, steps)
        write_diagnosis(diagnosis, args.out)
        phases.end()
    if args.json:
        cli.print_json(diagnosis.result)
        return
    taken = ", ".join(f"{phase} {seconds:.0f} s" for phase, seconds in phases.taken_s.items())
    details = f"{taken}\n{LayerCache().usage_text()}"
    print(diagnosis_screen(diagnosis.result, steps, args.out / "report.html", details, args.verbose))


def _steps(args: argparse.Namespace, diagnosis: Diagnosis) -> list[Step]:
    """Returns the commands to run next. They check and use the found model, or diagnose again with the stub of an
    unknown effect. If there is neither, the command shows the capture."""
    if diagnosis.stub:
        names = "model", "effects", "alpha", "least_share", "bin", "workers", *cli.SAME_RUN, "reference"
        same = [*cli.carried(args, *names), *([] if args.refine else ["--no-refine"])]
        stub = ("--effects", args.out / "effect_stub.py", "-o", args.out / "again")
        return [command("diagnose", args.capture, *same, *stub)]
    if diagnosis.sensor_model is None:
        return [command("view", args.capture, *cli.carried(args, "device"))]
    model = "--model", args.out / "model.json", *cli.carried(args, "effects", *cli.SAME_RUN)
    return [
        command("compare", args.capture, *model, "-o", args.out / "after", label="check"),
        command("simulate", args.capture, *model, "-o", args.out / "simulated", label="use"),
    ]


@contextmanager
def _told_where_stopped(folder: Path, bar: ProgressBar) -> Iterator[None]:
    """Wraps a diagnosis. Ctrl-C writes stopped.txt into `folder`: the phase, where results are kept, and how to
    continue. A block that ends normally removes an earlier run's file."""
    from activestereo.compare.cache import default_cache_folder

    note = folder / _STOPPED
    try:
        yield
    except KeyboardInterrupt as error:
        if not bar.phase:
            raise
        kept = f"renders and fits so far are kept in {default_cache_folder()}; the same command goes on from there"
        said = f"stopped in phase {bar.phase}: {kept}"
        write_text(note, said + "\n")
        raise type(error)(said) from None
    note.unlink(missing_ok=True)
