# SPDX-License-Identifier: Apache-2.0
"""Options NAME=X of simulate for the fields of whole records: the infrared imagers, and the cameras' optics."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from activestereo.cli.arguments import CommandError, real

if TYPE_CHECKING:
    from activestereo.camera.presets import StereoDepthSensorConfig

_MORE = "may be given several times; capi/generation/reference.md has all"


def add_records(group: argparse._ArgumentGroup) -> None:
    text = (
        "the infrared imagers: one of simsense's presets (d435, paper-d415, sapien, neutral), or a field of "
        "simsense_signal"
    )
    group.add_argument(
        "--ir-signal", action="append", default=[], type=_field, metavar="PRESET|NAME=X", help=f"{text}; {_MORE}"
    )
    for camera, whose in (("ir", "infrared cameras'"), ("rgb", "RGB camera's")):
        text = f"a field of the {whose} optics, as psf_sigma_px=0.7 (kuafu.Optics); {_MORE}"
        group.add_argument(f"--{camera}-optics", action="append", default=[], type=_field, metavar="NAME=X", help=text)


def set_records(config: StereoDepthSensorConfig, args: argparse.Namespace) -> None:
    """Puts what was given on top of what the sensor's configuration has."""
    import simsense

    if args.ir_signal:
        config.ir_signal = _imager(config.ir_signal, args.ir_signal, simsense.signal_preset("neutral"))
    for name, fields in (("ir_optics", args.ir_optics), ("rgb_optics", args.rgb_optics)):
        for field, value in fields:
            setattr(config, name, (getattr(config, name) or {}) | {field: value})


def _imager(
    signal: str | Mapping[str, float] | None, given: list[tuple[str, Any]], neutral: dict[str, float]
) -> dict[str, float]:
    import simsense

    out = simsense.signal_preset(signal) if isinstance(signal, str) else dict(signal or {})  # type: ignore[arg-type]
    for name, value in given:
        if value is None:
            out = simsense.signal_preset(name)  # type: ignore[arg-type]
        elif name in neutral and not isinstance(value, list):
            out[name] = value
        else:
            raise CommandError(f"--ir-signal {name}: an imager's fields are {', '.join(neutral)}, each one number")
    return out


def _field(text: str) -> tuple[str, float | int | list[float] | None]:
    """(name, number or numbers); (name, None) where there is no '='."""
    name, equals, value = text.partition("=")
    if not name or (equals and not value):
        raise argparse.ArgumentTypeError(f"a field is NAME=NUMBER or NAME=NUMBER,NUMBER,..., not '{text}'")
    numbers = [
        int(part) if part.strip().removeprefix("-").isdecimal() else real(part) for part in value.split(",") if equals
    ]
    return name, None if not equals else numbers[0] if len(numbers) == 1 else numbers
