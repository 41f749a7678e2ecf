# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo model show | diff | export`: prints a sensor model, or exports it as other simulators' noise
models."""

import argparse
from pathlib import Path

from activestereo.cli.arguments import add_shared, integer_from, make_folder, names_of, print_json
from activestereo.report.screen import wrapped_lines

EXPORTS = ("isaac", "gazebo", "elevation_mapping")

_TEXT = """\
A sensor model (model.json) in words, and in what other simulators have.

  show   what a model says: calibration, pattern, imager, effects, materials, and what the
         fit left over; which of its parts the engines simulate, and which cost a copy
  diff   what two models say differently
  export fits the noise models of other simulators to a model, or to a preset, by simulating it in
         rooms of solids; writes their own files and says what they cannot express

examples:
  activestereo model show out/diagnosis/model.json
  activestereo model diff before.json after.json
  activestereo model export model.json --to isaac,gazebo -o out/profiles
  activestereo model export D435 --held-out 5 -o out/profiles
"""


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "model", help="show a sensor model in words, tell two apart, export it", description=_TEXT
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, files, run, text in (
        ("show", "+", run_show, "what models say"),
        ("diff", 2, run_diff, "what two models say differently"),
    ):
        action = actions.add_parser(name, help=text)
        action.add_argument("files", nargs=files, type=Path, metavar="FILE", help="model.json")
        add_shared(action, effects=", where a model has some", json=True)
        action.set_defaults(run=run)
    export = actions.add_parser("export", help="as noise models of other simulators")
    export.add_argument("model", metavar="MODEL", help="model.json, or the name of a preset")
    text = f"comma-separated: {', '.join(EXPORTS)} (default: all)"
    export.add_argument("--to", type=names_of("system", EXPORTS), default=list(EXPORTS), metavar="NAMES", help=text)
    text = "also tells how far defaults and profiles are from the sensor in N other rooms"
    export.add_argument("--held-out", type=integer_from(0), default=0, metavar="N", help=text)
    text = "the preset that says what a model.json does not (default: D435)"
    export.add_argument("--sensor", default="D435", metavar="NAME", help=text)
    add_shared(export, out=True, device=True, samples={"default": 16, "help": "rays per pixel (default: 16)"})
    add_shared(export, seed="of the rooms", effects=", where the model has some", json=True)
    export.set_defaults(run=run_export)


def run_show(args: argparse.Namespace) -> None:
    from activestereo.compare.model_file import library
    from activestereo.model import model_json, read_model
    from activestereo.model.words import show

    effects = library(*args.effects)
    if args.json:
        print_json([{"file": str(file)} | model_json(read_model(file, effects)) for file in args.files])
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
        print_json(differences(*models))
    else:
        print(wrapped_lines((diff(*models) or "the two say the same").splitlines()))


def run_export(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.noise_profiles import export, profile_json
    from activestereo.camera.presets import StereoDepthSensorConfig
    from activestereo.common.progress_bar import ProgressBar
    from activestereo.compare.model_file import library
    from activestereo.model import read_model

    model = read_model(args.model, library(*args.effects)) if args.model.endswith(".json") else None
    config = (
        StereoDepthSensorConfig(args.model) if model is None else StereoDepthSensorConfig.from_model(model, args.sensor)
    )
    config.samples_per_pixel = args.spp
    make_folder(args.out)
    with ProgressBar("simulating the sensor") as bar:
        found = export(config, model, args.to, args.out, args.held_out, args.seed, args.device, bar)
    if args.json:
        print_json({name: profile_json(one) for name, one in found.items()})
        return
    left_out = sorted({e.effect.id for e in model.effects if e.surfaces}) if model is not None else []
    if left_out:
        print(f"left out, for they are on surfaces of a capture: {', '.join(left_out)}")
    for name, one in found.items():
        values = ", ".join(f"{key} {value:.4g}" for key, value in vars(one.profile).items())
        print(f"{name}: {one.file} after {one.seconds:.0f} s: {values}")
        for line in one.profile.LACKS:
            print(f"  cannot express {line}")
        if one.default_distance is not None and one.distance is not None:
            far = (f"{d.error_px:.3f} px and {d.holes:.3f} of holes" for d in (one.default_distance, one.distance))
            print("  from the sensor in other rooms: default {}, this profile {}".format(*far))
