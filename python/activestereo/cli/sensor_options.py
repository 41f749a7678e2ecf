# SPDX-License-Identifier: Apache-2.0
"""Adds the options that describe a sensor: one for each parameter of the engines' generated tables, lenses, shutters
and motion, and NAME=X fields of imagers and optics. Also writes maps and lines for both simulate and depth."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

import simsense
from activestereo.camera.config_limits import Readout
from activestereo.camera.plan import stated_signal
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.cli import arguments as cli
from activestereo.common.output_files import write_png
from activestereo.common.parameter import MATCHER, RIG, Parameter


def add_options(
    group: argparse._ArgumentGroup, table: Sequence[Parameter], defaults: Mapping[str, Any] | None = None
) -> None:
    """Adds one option for each parameter of `table`. The parsed value is None if the user does not give the option.
    defaults: {name: default that the help shows}, a value or words; other parameters show the table's default."""
    for p in table:
        if not p.on_command_line:
            continue
        default = (defaults or {}).get(p.name, p.default)
        if p.pair:
            usual = default if isinstance(default, str) else f"{default}x{default}"
            text = f"{p.pair}-width and -height at once (default: {usual})"
            group.add_argument(f"--{p.pair}", type=cli.size, metavar="WxH", help=text)
        names = [p.option] + ([f"--{p.short}"] if p.short else [])
        shown = {bool: str(default).lower(), tuple: "none; may be given several times"}.get(p.kind, default)
        possible = f"{p.possible or ' | '.join(p.choices)} {p.unit}".strip()
        facts = ", ".join(filter(None, [possible, f"default: {'none' if shown is None else shown}"]))
        kinds: dict[type, dict[str, Any]] = {
            bool: {"action": argparse.BooleanOptionalAction},
            tuple: {"action": "append", "choices": p.choices, "metavar": "NAME"},
            str: {"choices": p.choices, "metavar": "NAME"} if p.choices else {"metavar": "TEXT"},
            int: {"type": _within(p, cli.whole), "metavar": "N"},
            float: {"type": _within(p, cli.real), "metavar": "X"},
        }
        text = f"{p.doc} ({facts})".replace("%", "%%")
        group.add_argument(*names, dest=p.name, default=None, help=text, **kinds[p.kind])


def _within(p: Parameter, parse: Callable[[str], Any]) -> Callable[[str], Any]:
    """Returns an argparse type that parses p's number and refuses one outside of the engine's limits."""

    def number(text: str) -> Any:
        value = parse(text)
        if not p.takes(value):
            raise argparse.ArgumentTypeError(f"{p.name} is {text}, it must be {p.possible} {p.unit}".rstrip())
        return value

    return number


def given_parameters(args: argparse.Namespace, *tables: Sequence[Parameter]) -> dict[str, Any]:
    """Returns {name: value} of the tables' parameters that the user gave."""
    table = [p for one in tables for p in one]
    found = {p.name: getattr(args, p.name) for p in table if p.on_command_line}
    for p, after in zip(table, table[1:], strict=False):
        if p.pair and getattr(args, p.pair) is not None:
            found[p.name], found[after.name] = getattr(args, p.pair)
    given = {name: value for name, value in found.items() if value is not None}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}


_MAPS = ("confidence", "reason")


def add_matching(parser: cli.Parser, defaults: Mapping[str, Any]) -> None:
    """Adds the rare options of the depth engine: matcher and rig parameters, and its maps. defaults: the command's own
    values."""
    text = "Semi-global matching of census descriptors, and what becomes of its depth."
    group = parser.rare_group("matching", text)
    add_options(group, MATCHER, defaults)
    add_options(group, RIG)
    text = "write confidence.png too, of the left infrared image: 16 bits, 65535 = sure, 0 = nothing was measured"
    group.add_argument("--confidence", action="store_true", help=text)
    text = "write reason.png too, of the left infrared image: 8 bits, why a pixel has no depth, as simsense.REASONS "
    group.add_argument("--reason", action="store_true", help=f"{text}counts; 0 = it has one")


def wanted_maps(args: argparse.Namespace) -> tuple[str, ...]:
    """Returns the names of the optional maps that --confidence and --reason request."""
    return tuple(name for name in _MAPS if getattr(args, name))


def write_maps(folder: Path, maps: Mapping[str, np.ndarray]) -> None:
    """Writes each map as folder/NAME.png. maps: {name: [height][width]}; confidence, 0 to 1, becomes 16-bit."""
    for name, image in maps.items():
        write_png(folder / f"{name}.png", np.rint(65535.0 * image).astype(np.uint16) if name == "confidence" else image)


def stage_table(groups: Mapping[str, Mapping[str, float]]) -> str:
    """Returns a text table of times in ms. groups: {group: {stage: ms}}. A group's sum comes before its stages; stages
    below 0.1 % of the total are left out."""
    total = sum(sum(stages.values()) for stages in groups.values())
    lines = [f"{'stage':32}{'time':>12}"]
    for group, stages in groups.items():
        lines.append(f"{group:32}{sum(stages.values()):>9.1f} ms")
        lines += [f"  {name:30}{time:>9.1f} ms" for name, time in stages.items() if time >= 0.001 * total]
    return "\n".join(lines)


def matching_words(engine: simsense.Engine) -> dict[str, Any]:
    """Returns the engine's matching parameters as {name: value}, with a word for each enumerated choice."""
    choices = {p.name: p.choices for p in MATCHER if p.choices}
    return {name: choices[name][int(value)] if name in choices else value for name, value in engine.parameters.items()}


def matching_line(engine: simsense.Engine) -> str:
    """Returns one line with the engine's main matching parameters."""
    p = engine.parameters
    first, last = p["min_disparity"], p["min_disparity"] + p["max_disparity"] - 1
    checks = f"uniqueness {p['uniqueness_ratio']} %, left-right {p['lr_max_diff']}, median {p['median_size']}"
    windows = f"census {p['census_width']}x{p['census_height']}, block {p['block_width']}x{p['block_height']}"
    penalties, depths = f"p1 {p['p1']}, p2 {p['p2']}", f"{p['min_depth_m']:g}..{p['max_depth_m']:g} m"
    return f"matching: disparities {first}..{last}, {windows}, {penalties}, {checks}, {depths}"


_MORE = "may be given several times; in Python {} has all"


def add_records(group: argparse._ArgumentGroup) -> None:
    text = "the infrared imagers: one of simsense's presets (d435, paper-d415, sapien, neutral), or a field of "
    text += "theirs; " + _MORE.format("simsense.signal_preset('neutral')")
    group.add_argument("--ir-signal", action="append", default=[], type=_field, metavar="PRESET|NAME=X", help=text)
    for camera, whose in (("ir", "infrared cameras'"), ("rgb", "RGB camera's")):
        text = f"a field of the {whose} optics, as psf_sigma_px=0.7; {_MORE.format('help(kuafu.Optics)')}"
        group.add_argument(f"--{camera}-optics", action="append", default=[], type=_field, metavar="NAME=X", help=text)


def _field(text: str) -> tuple[str, float | int | list[float] | None]:
    """Parses NAME=X or NAME=X,Y,... into (name, number or list of numbers). A text without "=" gives (name, None)."""
    name, equals, value = text.partition("=")
    if not name or (equals and not value):
        raise argparse.ArgumentTypeError(f"a field is NAME=NUMBER or NAME=NUMBER,NUMBER,..., not '{text}'")
    if not equals:
        return name, None
    found = [int(part) if part.strip().removeprefix("-").isdecimal() else cli.real(part) for part in value.split(",")]
    return name, found[0] if len(found) == 1 else found


def set_records(config: StereoDepthSensorConfig, args: argparse.Namespace) -> None:
    """Writes the fields that --ir-signal, --ir-optics and --rgb-optics give into the configuration; other fields keep
    their values."""
    if args.ir_signal:
        signal, neutral = stated_signal(config), simsense.signal_preset("neutral")
        for name, value in args.ir_signal:
            if value is None:
                signal = simsense.signal_preset(name)
            elif name not in neutral or isinstance(value, list):
                raise cli.CommandError(
                    f"--ir-signal {name}: an imager's fields are {', '.join(neutral)}, each one number"
                )
            elif name == "exposure_s":
                raise cli.CommandError("--ir-signal exposure_s: --ir-exposure states it")
            elif name == "black_level_dn":  # the sensor adds the configuration's to the signal's
                config.ir_black_level_dn = value - signal.get(name, 0.0)
            else:
                signal[name] = value
        config.ir_signal = signal
    for name, fields in (("ir_optics", args.ir_optics), ("rgb_optics", args.rgb_optics)):
        for field, value in fields:
            setattr(config, name, (getattr(config, name) or {}) | {field: value})


def add_camera_options(group: argparse._ArgumentGroup) -> None:
    for camera, whose in (("ir", "both infrared cameras'"), ("rgb", "the RGB camera's")):
        lens = group.add_mutually_exclusive_group()
        text = f"{whose} lens: Brown and Conrady's k1,k2,p1,p2[,k3[,k4,k5,k6]], as in OpenCV (default: none)"
        lens.add_argument(f"--{camera}-distortion", type=_lens, metavar="K1,...", help=text)
        text, name = f"{whose} fisheye lens: Kannala and Brandt's k1,k2,k3,k4, as in OpenCV", f"{camera}_distortion"
        lens.add_argument(
            f"--{camera}-fisheye", dest=name, metavar="K1,...", help=text,
            type=lambda given: tuple(map(float, cli.numbers(given, (4,), "a fisheye lens"))),
        )  # fmt: skip
    text = "what the sensor does while its shutters are open, m/s and rad/s along and about the left infrared camera's "
    text += "x (right), y (down), z (forward) (default: it stands still)"
    group.add_argument("--velocity", type=_twist, metavar="VX,VY,VZ[,WX,WY,WZ]", help=text)
    text = "seconds that each line is exposed after the one before; 0 = a global shutter (default: 0)"
    for camera, cameras in (("ir", "the infrared cameras"), ("rgb", "the RGB camera")):
        words = f"rolling shutter of {cameras}: {text}"
        group.add_argument(f"--{camera}-line-time-s", type=cli.positive, metavar="S", help=words)
    text = f"the way their lines go, {' | '.join(get_args(Readout))}; a sensor built in upside down has rows_up"
    group.add_argument("--readout", choices=get_args(Readout), metavar="NAME", help=f"{text} (default: rows_down)")
    text = "how long the RGB camera is open, which only blurs what moves (default: 0)"
    group.add_argument("--rgb-exposure-s", type=cli.positive, metavar="S", help=text)


def set_cameras(config: StereoDepthSensorConfig, args: argparse.Namespace) -> None:
    """Writes the given lens, shutter and readout options into the sensor's configuration."""
    if args.readout is not None and not (args.ir_line_time_s or args.rgb_line_time_s):
        needed = "--ir-line-time-s or --rgb-line-time-s as well"
        raise cli.CommandError(f"--readout {args.readout} is of a rolling shutter: give {needed}")
    own = ("ir_distortion", "rgb_distortion", "ir_line_time_s", "rgb_line_time_s", "rgb_exposure_s")
    values = {name: getattr(args, name) for name in own} | dict.fromkeys(("ir_readout", "rgb_readout"), args.readout)
    for name, value in values.items():
        if value is not None:
            setattr(config, name, value)


def _lens(text: str) -> tuple[float, ...]:
    values = cli.numbers(text, (4, 5, 8), "a lens")
    return tuple(map(float, np.pad(values, (0, max(0, 5 - len(values))))))


def _twist(text: str) -> np.ndarray:
    values = cli.numbers(text, (3, 6), "a velocity")
    return np.concatenate([values, np.zeros(6 - len(values))])
