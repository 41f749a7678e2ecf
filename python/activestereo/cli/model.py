# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo add`: adds an effect to a sensor model or changes its parameters. Implements `activestereo
model show | export`: prints a model, or exports one as other simulators' noise models."""

import argparse
from pathlib import Path

from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.cli import arguments as cli
from activestereo.common.input_files import read_json
from activestereo.common.progress_bar import ProgressBar
from activestereo.common.shown import printable
from activestereo.report.screen import wrapped_lines

EXPORTS = ("isaac", "gazebo", "elevation_mapping")

_ADD = """\
Adds an effect to a model, or gives one that it has other parameters. They come
from a diagnosis (--from), from --set, or are the effect's typical ones. All else
in the model stays. Then simulate, compare and diagnose take the new model.

examples:
  activestereo add rolling_shutter --from out/diagnose.json -o model2.json
  activestereo add specular --set factor=0.6 --on cup --model model.json -o model.json
"""

_TEXT = """\
A sensor model (model.json) in words, and in what other simulators have.

examples:
  activestereo model show out/diagnosis/model.json
  activestereo model export model.json --to isaac,gazebo -o out/profiles
  activestereo model export D435 --held-out 5 -o out/profiles
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
    parser = cli.add_command(commands, "model", "show a sensor model in words, export it", _TEXT)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    show = cli.add_command(actions, "show", "all that models say, and which parts cost a copy", "", run_show)
    show.add_argument("files", nargs="+", type=Path, metavar="FILE", help="model.json")
    cli.add_shared(show, effects=", where a model has some", json=True)
    export = cli.add_command(actions, "export", "fit noise models of other simulators to it", "", run_export)
    export.add_argument("model", metavar="MODEL", help="model.json, or the name of a preset")
    text = f"comma-separated: {', '.join(EXPORTS)} (default: all)"
    export.add_argument("--to", type=cli.names_of("system", EXPORTS), default=list(EXPORTS), metavar="NAMES", help=text)
    text = "also tells how far defaults and profiles are from the sensor in N other rooms"
    export.add_argument("--held-out", type=cli.integer_from(0), default=0, metavar="N", help=text)
    text = "the preset that says what a model.json does not (default: D435)"
    export.add_argument("--sensor", metavar="NAME", help=text)
    cli.add_shared(export, out=True, device=True, samples={"default": 16, "help": "rays per pixel (default: 16)"})
    cli.add_shared(export, seed="of the rooms", effects=", where the model has some", json=True)


def run_add(args: argparse.Namespace) -> None:
    from activestereo.effects.core.surfaces import SURFACES
    from activestereo.model import Quantity, SensorModel, read_model, write_model
    from activestereo.model.diagnosed import found_effect
    from activestereo.model.library import find, library
    from activestereo.model.words import quantity_text

    cli.check_out_file(args.out)
    effects = library(*args.effects)
    model = SensorModel() if args.model is None else read_model(args.model, effects)
    effect = find(effects, args.effect)
    if args.on and SURFACES not in effect.parameters:
        raise cli.CommandError(f"--on {args.on[0]}: {effect.id} is not an effect of surfaces")
    known = next((one for one in model.effects if one.effect.id == effect.id and args.set), None)
    given: dict[str, Quantity] = dict(known.parameters) if known else {}
    surfaces: tuple[str, ...] = known.surfaces if known else ()
    if args.diagnosis is not None:
        if args.diagnosis.is_dir():
            args.diagnosis /= "diagnose.json"
        try:
            diagnosis = read_json(args.diagnosis)
        except ValueError as error:
            raise cli.CommandError(f"{error}; a diagnose.json is asked for") from error
        if not isinstance(diagnosis, dict) or "ranking" not in diagnosis:
            raise cli.CommandError(f"{args.diagnosis}: not a diagnose.json: it has no ranking")
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
    from activestereo.model import model_json, read_model
    from activestereo.model.library import library
    from activestereo.model.words import show

    effects = library(*args.effects)
    if args.json:
        cli.print_json([{"file": str(file)} | model_json(read_model(file, effects)) for file in args.files])
        return
    many = len(args.files) > 1
    texts = [f"{file}: " * many + show(read_model(file, effects)) for file in args.files]
    print(wrapped_lines("\n\n".join(texts).splitlines()))


def run_export(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.noise_profiles import export
    from activestereo.model import read_model
    from activestereo.model.library import library

    model = read_model(args.model, library(*args.effects)) if args.model.endswith(".json") else None
    if model is None and args.sensor is not None:
        raise cli.CommandError(
            f"--sensor {args.sensor} completes a model.json, and {args.model} is a preset: leave it out"
        )
    of = StereoDepthSensorConfig
    config = of(args.model) if model is None else of.from_model(model, args.sensor or "D435")
    config.samples_per_pixel = args.spp
    cli.make_folder(args.out)
    with ProgressBar("simulating the sensor") as bar:
        found = export(config, model, args.to, args.out, args.held_out, args.seed, args.device, bar)
    if args.json:
        cli.print_json(found)
        return
    left_out = sorted({e.effect.id for e in model.effects if e.surfaces}) if model is not None else []
    if left_out:
        print(f"left out, for they are on surfaces of a capture: {', '.join(left_out)}")
    for name, told in found.items():
        values = ", ".join(f"{key} {value:.4g}" for key, value in told["parameters"].items())
        print(f"{name}: {args.out / told['file']}: {values}")
        for line in told["lacks"]:
            print(f"  cannot express {line}")
        if told["held_out"]:
            far = ("{error_px:.3f} px and {holes:.3f} of holes".format(**d) for d in told["held_out"].values())
            print("  from the sensor in other rooms: default {}, this profile {}".format(*far))
