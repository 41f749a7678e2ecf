# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo add`, which adds an effect to a sensor model or changes its parameters, and `activestereo
model show | diff`, which prints models."""

import argparse
from pathlib import Path

from activestereo.cli import arguments as cli
from activestereo.common.input_files import read_json
from activestereo.common.shown import printable
from activestereo.report.screen import wrapped_lines

_ADD = """\
Adds an effect to a model, or gives one that it has other parameters. They come
from a diagnosis (--from), from --set, or are the effect's typical ones. All else
in the model stays. Then simulate, compare and diagnose take the new model.

examples:
  activestereo add rolling_shutter --from out/diagnose.json -o model2.json
  activestereo add specular --set factor=0.6 --on cup --model model.json -o model.json
"""

_TEXT = """\
A sensor model (model.json) in words.

  show   what a model says: calibration, pattern, imager, effects, materials, and what the
         fit left over; which of its parts the engines simulate, and which cost a copy
  diff   what two models say differently

examples:
  activestereo model show out/diagnosis/model.json
  activestereo model diff before.json after.json
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "add", "add an effect to a model", _ADD, run_add)
    parser.add_argument("effect", metavar="EFFECT", help="an id of 'activestereo effect list' or of your own file")
    cli.add_shared(parser, model="model.json to start from (default: no effects)")
    text = "a diagnose.json that has the parameters"
    parser.add_argument("--from", dest="diagnosis", type=Path, metavar="FILE", help=text)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter's value")
    text = "a surface that shows it, by its material's name (default: all)"
    parser.add_argument("--on", action="append", default=[], metavar="MATERIAL", help=text)
    cli.add_shared(parser, effects=True)
    text = "the model to write; may be the same file"
    parser.add_argument("-o", "--out", required=True, type=Path, metavar="FILE", help=text)
    parser = cli.add_command(commands, "model", "show a sensor model in words, tell two apart", _TEXT)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    show = cli.add_command(actions, "show", "what models say", "", run_show)
    show.add_argument("files", nargs="+", type=Path, metavar="FILE", help="model.json")
    diff = cli.add_command(actions, "diff", "what two models say differently", "", run_diff)
    diff.add_argument("files", nargs=2, type=Path, metavar="FILE", help="model.json")
    for action in (show, diff):
        cli.add_shared(action, effects=", where a model has some", json=True)


def run_add(args: argparse.Namespace) -> None:
    from activestereo.compare.model_file import find, library
    from activestereo.effects.core.surfaces import SURFACES
    from activestereo.model import Quantity, SensorModel, read_model, write_model
    from activestereo.model.diagnosed import found_effect
    from activestereo.model.words import quantity_text

    cli.check_out_file(args.out)
    effects = library(*args.effects)
    model = SensorModel() if args.model is None else read_model(args.model, effects)
    effect = find(effects, args.effect)
    if args.on and SURFACES not in effect.parameters:
        raise cli.CommandError(f"--on {args.on[0]}: {effect.id} is not an effect of surfaces")
    given: dict[str, Quantity] = {}
    surfaces: tuple[str, ...] = ()
    if args.diagnosis is not None:
        try:
            diagnosis = read_json(args.diagnosis)
        except ValueError as error:
            raise cli.CommandError(f"{error}; a diagnose.json is asked for") from error
        if not isinstance(diagnosis, dict):
            raise cli.CommandError(f"{args.diagnosis}: not a diagnose.json: it holds no object")
        try:
            given, surfaces = found_effect(diagnosis, effect.id)
        except (TypeError, AttributeError, KeyError) as error:
            raise cli.CommandError(f"{args.diagnosis}: not a diagnose.json of this program: {error}") from error
    units = {p.name: p.unit for p in effect.parameters}
    for text in args.set:
        name, _, value = text.partition("=")
        try:
            given[name] = Quantity(float(value), unit=units.get(name, ""), source="set by hand")
        except ValueError:
            raise cli.CommandError(f"--set takes NAME=VALUE, not '{text}'") from None
    if not given:
        typical = {name: value for name, value in effect.typical_values.items() if name != SURFACES.name}
        given = {name: Quantity(value, unit=units[name], source="typical") for name, value in typical.items()}
    model = model.with_effect(effect, given, tuple(args.on) or surfaces)
    write_model(args.out, model)
    added = model.effects[-1]
    on = f" on {', '.join(added.surfaces)}" if added.surfaces else ""
    print(f"{effect.id}{on}: " + ", ".join(f"{name} = {quantity_text(q)}" for name, q in added.parameters.items()))
    print(f"written: {printable(args.out)} with {', '.join(e.effect.id for e in model.effects)}")


def run_show(args: argparse.Namespace) -> None:
    from activestereo.compare.model_file import library
    from activestereo.model import model_json, read_model
    from activestereo.model.words import show

    effects = library(*args.effects)
    if args.json:
        cli.print_json([{"file": str(file)} | model_json(read_model(file, effects)) for file in args.files])
        return
    many = len(args.files) > 1
    texts = [f"{file}: " * many + show(read_model(file, effects)) for file in args.files]
    print(wrapped_lines("\n\n".join(texts).splitlines()))


def run_diff(args: argparse.Namespace) -> None:
    from activestereo.compare.model_file import library
    from activestereo.model import read_model
    from activestereo.model.words import diff, differences

    effects = library(*args.effects)
    models = [read_model(file, effects) for file in args.files]
    if args.json:
        cli.print_json(differences(*models))
    else:
        print(wrapped_lines((diff(*models) or "the two say the same").splitlines()))
