# SPDX-License-Identifier: Apache-2.0
"""activestereo model show | diff: a sensor model in words."""

import argparse
from pathlib import Path

from activestereo.cli.arguments import add_shared, print_json

_TEXT = """\
A sensor model (model.json) in words.

  show   what a model says: calibration, pattern, imager, effects, materials, and what the
         fit left over; which of its parts the engines simulate, and which cost a copy
  diff   what two models say differently

examples:
  activestereo model show out/diagnosis/model.json
  activestereo model diff before.json after.json
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser("model", help="show a sensor model in words, tell two apart", description=_TEXT)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, files, run, text in (
        ("show", "+", run_show, "what models say"),
        ("diff", 2, run_diff, "what two models say differently"),
    ):
        action = actions.add_parser(name, help=text)
        action.add_argument("files", nargs=files, type=Path, metavar="FILE", help="model.json")
        add_shared(action, effects=", where a model has some", json=True)
        action.set_defaults(run=run)


def run_show(args: argparse.Namespace) -> None:
    from activestereo.compare.model_file import library
    from activestereo.model import model_json, read_model
    from activestereo.model.words import show

    effects = library(*args.effects)
    if args.json:
        print_json([{"file": str(file)} | model_json(read_model(file, effects)) for file in args.files])
        return
    texts = [show(read_model(file, effects)) for file in args.files]
    print(
        "\n\n".join(f"{file}: {text}" if len(texts) > 1 else text for file, text in zip(args.files, texts, strict=True))
    )


def run_diff(args: argparse.Namespace) -> None:
    from activestereo.compare.model_file import library
    from activestereo.model import read_model
    from activestereo.model.words import diff, differences

    effects = library(*args.effects)
    models = [read_model(file, effects) for file in args.files]
    if args.json:
        print_json(differences(*models))
    else:
        print(diff(*models) or "the two say the same")
