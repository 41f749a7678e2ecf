# SPDX-License-Identifier: Apache-2.0
"""activestereo benchmark inject: a known effect in the measured images of a capture."""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.cli.arguments import CommandError, Commands, add_shared, check_out_file, positive
from activestereo.common.shown import printable

_TEXT = """\
Copies a capture and puts one known effect into its measured infrared images, so that
the lab can be asked for a cause that is known amid a real camera's noise and
surfaces. EFFECT is blur, gain or black_level (of one camera), veiling_glare, ghost,
radial_distortion, tangential_distortion, bands, row_noise, dead_dots, vignetting or
response. DIR/answer.json says what was put in, which names of the lab's library are
right, and by how much the images changed; diagnose does not read it.

examples:
  activestereo benchmark inject captures/sofa vignetting --strength strong -o out/hidden
  activestereo benchmark inject captures/sofa blur --strength 1.1 --seed 7 -o out/blurred
  activestereo benchmark inject captures/sofa --sheet out/kinds.png
"""


def add_inject(kinds: Commands) -> None:
    parser = kinds.add_parser(
        "inject", help="put a known effect into the measured images of a capture", description=_TEXT
    )
    parser.add_argument("capture", type=Path, metavar="CAPTURE", help="a capture's folder")
    parser.add_argument("effect", nargs="?", metavar="EFFECT", help="one of those above")
    text = "weak, medium, strong, or a value of the effect's parameter (default: medium)"
    parser.add_argument("--strength", default="medium", metavar="weak|medium|strong|VALUE", help=text)
    add_shared(parser, seed="of what is drawn: the camera, phases, directions, noise")
    text = "the images' black level (default: their darkest thousandth)"
    parser.add_argument("--black-level", type=positive, metavar="DN", help=text)
    parser.add_argument("-o", "--out", type=Path, metavar="DIR", help="the capture's folder, which must not exist")
    text = "in place of a capture a picture: what each effect changes in the first frame"
    parser.add_argument("--sheet", type=Path, metavar="FILE.png", help=text)
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.inject.inject import ANSWER, plan, write_injected
    from activestereo.benchmarks.inject.sheet import write_sheet
    from activestereo.capture.capture import read_capture
    from activestereo.common.progress_bar import ProgressBar

    if args.sheet is not None:
        if args.effect is not None or args.out is not None:
            raise CommandError("--sheet shows all effects: leave out EFFECT and --out")
        check_out_file(args.sheet)
        strength = args.strength
        write_sheet(read_capture(args.capture), strength, args.seed, args.black_level, args.sheet)
        print(f"written: {printable(args.sheet)}")
        return
    if args.effect is None or args.out is None:
        raise CommandError("give EFFECT and --out DIR, or --sheet FILE.png")
    if args.out.exists():
        raise CommandError(f"{args.out} exists already: a new folder is written")
    if not args.out.absolute().parent.is_dir():
        raise CommandError(f"the folder {args.out.parent} does not exist: make it first")
    injection = plan(read_capture(args.capture), args.effect, args.strength, args.seed, args.black_level)
    with ProgressBar(f"{args.effect} into {len(injection.capture.frames)} frames") as bar:
        answer = write_injected(injection, args.out, bar)
    changed = ", ".join(f"{value:.2f} DN in {split} frames" for split, value in answer["changed_rms_dn"].items())
    noise = injection.noise_model
    print(f"{args.effect}: {', '.join(f'{name} = {value:.4g}' for name, value in answer['parameters'].items())}")
    print(f"in the {' and '.join(injection.sides)} images; they change by {changed} (root mean square)")
    print(
        f"noise: {noise.floor_dn2**0.5:.2f} DN without light, by {noise.measured}; black level "
        f"{injection.black_dn:g} DN"
        + (" (assumed: the darkest pixels)" if args.black_level is None else "")
    )
    print(f"written: {printable(args.out)}, with the answer in {ANSWER}")
