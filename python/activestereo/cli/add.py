# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo add`: adds an effect to a sensor model file, or changes its parameters."""

import argparse
from pathlib import Path

from activestereo.cli.arguments import CommandError, add_shared, check_out_file
from activestereo.common.input_files import read_json
from activestereo.common.shown import printable

_TEXT = """\
Adds an effect to a model, or gives one that it has other parameters. They come
from a diagnosis (--from), from --set, or are the effect's typical ones. All else
in the model stays. Then simulate, compare and diagnose take the new model.

examples:
  activestereo add rolling_shutter --from out/diagnose.json -o model2.json
  activestereo add specular --set factor=0.6 --on cup --model model.json -o model.json
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser("add", help="add an effect to a model", description=_TEXT)
    parser.add_argument("effect", metavar="EFFECT", help="an id of 'activestereo effect list' or of your own file")
    add_shared(parser, model="model.json to start from (default: no effects)")
    text = "a diagnose.json that has the parameters"
    parser.add_argument("--from", dest="diagnosis", type=Path, metavar="FILE", help=text)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter's value")
    text = "a surface that shows it, by its material's name (default: all)"
    parser.add_argument("--on", action="append", default=[], metavar="MATERIAL", help=text)
    add_shared(parser, effects=True)
    text = "the model to write; may be the same file"
    parser.add_argument("-o", "--out", required=True, type=Path, metavar="FILE", help=text)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    from activestereo.compare.model_file import find, library
    from activestereo.effects.core.surfaces import SURFACES
    from activestereo.model import Quantity, SensorModel, read_model, write_model
    from activestereo.model.diagnosed import found_effect
    from activestereo.model.words import quantity_text

    check_out_file(args.out)
    effects = library(*args.effects)
    model = SensorModel() if args.model is None else read_model(args.model, effects)
    effect = find(effects, args.effect)
    if args.on and SURFACES not in effect.parameters:
        raise CommandError(f"--on {args.on[0]}: {effect.id} is not an effect of surfaces")
    given: dict[str, Quantity] = {}
    surfaces: tuple[str, ...] = ()
    if args.diagnosis is not None:
        try:
            diagnosis = read_json(args.diagnosis)
        except ValueError as error:
            raise CommandError(f"{error}; a diagnose.json is asked for") from error
        if not isinstance(diagnosis, dict):
            raise CommandError(f"{args.diagnosis}: not a diagnose.json: it holds no object")
        try:
            given, surfaces = found_effect(diagnosis, effect.id)
        except (TypeError, AttributeError, KeyError) as error:
            raise CommandError(f"{args.diagnosis}: not a diagnose.json of this program: {error}") from error
    units = {p.name: p.unit for p in effect.parameters}
    for text in args.set:
        name, _, value = text.partition("=")
        try:
            given[name] = Quantity(float(value), unit=units.get(name, ""), source="set by hand")
        except ValueError:
            raise CommandError(f"--set takes NAME=VALUE, not '{text}'") from None
    if not given:
        given = {
            n: Quantity(v, unit=units[n], source="typical")
            for n, v in effect.typical_values.items()
            if n != SURFACES.name
        }
    model = model.with_effect(effect, given, tuple(args.on) or surfaces)
    write_model(args.out, model)
    added = model.effects[-1]
    on = f" on {', '.join(added.surfaces)}" if added.surfaces else ""
    print(f"{effect.id}{on}: " + ", ".join(f"{name} = {quantity_text(q)}" for name, q in added.parameters.items()))
    print(f"written: {printable(args.out)} with {', '.join(e.effect.id for e in model.effects)}")
