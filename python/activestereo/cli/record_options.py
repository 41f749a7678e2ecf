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
        text = f"a field of the {whose} optics, as psf_sigma_px=0.7 (kuafu.Film); {_MORE}"
        group.add_argument(f"--{camera}-film", action="append", default=[], type=_field, metavar="NAME=X", help=text)


def set_records(config: StereoDepthSensorConfig, args: argparse.Namespace) -> None:
    """Puts what was given on top of what the sensor's configuration has."""
    import kuafu
    import simsense

    if args.ir_signal:
        config.ir_signal = _imager(config.ir_signal, args.ir_signal, simsense.signal_preset("neutral"))
    for name, fields in (("ir_film", args.ir_film), ("rgb_film", args.rgb_film)):
        for field, value in fields:
            setattr(config, name, (getattr(config, name) or {}) | {field: value})
        if fields:
            _check(f"--{name.replace('_', '-')}", kuafu.Film(), getattr(config, name))


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


def _check(option: str, record: Any, fields: Mapping[str, Any]) -> None:
    """The record takes the fields: there is such a one, and it has as many numbers."""
    for name, value in fields.items():
        known = [field for field in dir(record) if not field.startswith("_")]
        if name not in known:
            raise CommandError(f"{option} {name}: there is no such field (known: {', '.join(known)})")
        try:
            setattr(record, name, value)
        except TypeError:
            count = len(getattr(record, name)) if isinstance(getattr(record, name), tuple) else 1
            raise CommandError(f"{option} {name} needs {count} number{'s' if count > 1 else ''}, not {value}") from None


def _field(text: str) -> tuple[str, float | int | list[float] | None]:
    """(name, number or numbers); (name, None) where there is no '='."""
    name, equals, value = text.partition("=")
    if not name or (equals and not value):
        raise argparse.ArgumentTypeError(f"a field is NAME=NUMBER or NAME=NUMBER,NUMBER,..., not '{text}'")
    numbers = [
        int(part) if part.strip().removeprefix("-").isdecimal() else real(part) for part in value.split(",") if equals
    ]
    return name, None if not equals else numbers[0] if len(numbers) == 1 else numbers
