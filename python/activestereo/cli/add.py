"""activestereo add: an effect more in a model file."""

import argparse
import json
from pathlib import Path

from activestereo.cli.arguments import CommandError

_TEXT = """\
Adds an effect to a model, or gives one that it has other parameters. They come
from a diagnosis (--from), from --set, or are the effect's typical ones. Then
compare and diagnose take the new model: compare --model model2.json.

example:
  activestereo add rolling_shutter --from out/diagnose.json -o model2.json
"""


def add_parser(commands):
    parser = commands.add_parser(
        "add", help="add an effect to a model", description=_TEXT, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("effect", metavar="EFFECT", help="an id of 'activestereo effect list' or of your own file")
    parser.add_argument("--model", type=Path, metavar="FILE", help="model.json to start from (default: no effects)")
    parser.add_argument("--from", dest="diagnosis", type=Path, metavar="FILE", help="a diagnose.json that has the parameters")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter's value")
    parser.add_argument("--effects", type=Path, action="append", default=[], metavar="FILE", help="your own effects")
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="FILE", help="the model to write")
    parser.set_defaults(run=run)


def run(args):
    from activestereo.lab.model_file import added_from, find, library, read_model, write_model

    effects = library(*args.effects)
    model = read_model(args.model, effects)
    effect = find(effects, args.effect)
    values = {} if args.diagnosis is None else added_from(_read(args.diagnosis), effect.id)
    values |= dict(_assignment(text) for text in args.set)
    values = effect.values(values or effect.typical_values)
    model = model.with_effect(effect, **values)
    write_model(args.output, model)
    units = {p.name: p.unit for p in effect.parameters}
    print(f"{effect.id}: " + ", ".join(f"{name} = {value:.5g} {units[name]}" for name, value in values.items()))
    print(f"written: {args.output} with {', '.join(e.id for e, _ in model.effects)}")


def _read(path):
    try:
        diagnosis = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise CommandError(f"{path}: not a diagnose.json: {error}") from error
    if not isinstance(diagnosis, dict):
        raise CommandError(f"{path}: not a diagnose.json: it holds no object")
    return diagnosis


def _assignment(text):
    name, sign, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise CommandError(f"--set takes NAME=VALUE, not '{text}'") from None
