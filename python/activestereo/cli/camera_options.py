# SPDX-License-Identifier: Apache-2.0
"""Adds the camera options of simulate: lenses, shutters, the sensor's motion during exposure, and NAME=X fields of the
imagers and optics."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.cli.arguments import CommandError, numbers, positive, real

if TYPE_CHECKING:
    from activestereo.camera.presets import StereoDepthSensorConfig

_MORE = "may be given several times; capi/generation/reference.md has all"


def add_records(group: argparse._ArgumentGroup) -> None:
    text = (
        "the infrared imagers: one of simsense's presets (d435, paper-d415, sapien, neutral), or a field of "
        "simsense_signal"
    )
    text = f"{text}; {_MORE}"
    group.add_argument("--ir-signal", action="append", default=[], type=_field, metavar="PRESET|NAME=X", help=text)
    for camera, whose in (("ir", "infrared cameras'"), ("rgb", "RGB camera's")):
        text = f"a field of the {whose} optics, as psf_sigma_px=0.7 (kuafu.Optics); {_MORE}"
        group.add_argument(f"--{camera}-optics", action="append", default=[], type=_field, metavar="NAME=X", help=text)


def set_records(config: StereoDepthSensorConfig, args: argparse.Namespace) -> None:
    """Writes the fields given by --ir-signal, --ir-optics and --rgb-optics into the configuration; other fields
    stay."""
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
    """Parses NAME=X or NAME=X,Y,... into (name, number or list of numbers). A text without "=" gives (name, None)."""
    name, equals, value = text.partition("=")
    if not name or (equals and not value):
        raise argparse.ArgumentTypeError(f"a field is NAME=NUMBER or NAME=NUMBER,NUMBER,..., not '{text}'")
    numbers = [
        int(part) if part.strip().removeprefix("-").isdecimal() else real(part) for part in value.split(",") if equals
    ]
    return name, None if not equals else numbers[0] if len(numbers) == 1 else numbers


READOUTS = ("rows_down", "rows_up", "columns_right", "columns_left")


def add_camera_options(group: argparse._ArgumentGroup) -> None:
    for camera, whose in (("ir", "both infrared cameras'"), ("rgb", "the RGB camera's")):
        lens = group.add_mutually_exclusive_group()
        text = f"{whose} lens: Brown and Conrady's k1,k2,p1,p2[,k3[,k4,k5,k6]], as in OpenCV"
        lens.add_argument(f"--{camera}-distortion", type=_lens, metavar="K1,...", help=f"{text} (default: none)")
        text = f"{whose} fisheye lens: Kannala and Brandt's k1,k2,k3,k4, as in OpenCV"
        lens.add_argument(
            f"--{camera}-fisheye", type=_fisheye, dest=f"{camera}_distortion", metavar="K1,...", help=text
        )
    text = (
        "what the sensor does while its shutters are open, m/s and rad/s along and about the left infrared camera's "
        "x (right), y (down), z (forward)"
    )
    text = f"{text} (default: it stands still)"
    group.add_argument("--velocity", type=_twist, metavar="VX,VY,VZ[,WX,WY,WZ]", help=text)
    text = "seconds that each line is exposed after the one before; 0 = a global shutter (default: 0)"
    text = f"rolling shutter of the infrared cameras: {text}"
    group.add_argument("--ir-line-time-s", type=positive, metavar="S", help=text)
    group.add_argument("--rgb-line-time-s", type=positive, metavar="S", help=f"the same of the RGB camera: {text}")
    text = f"the way their lines go, {' | '.join(READOUTS)}; a sensor built in upside down has rows_up"
    group.add_argument("--readout", choices=READOUTS, metavar="NAME", help=f"{text} (default: rows_down)")
    text = "how long the RGB camera is open, which only blurs what moves (default: 0)"
    group.add_argument("--rgb-exposure-s", type=positive, metavar="S", help=text)


def set_cameras(config: StereoDepthSensorConfig, args: argparse.Namespace) -> None:
    """Writes the given lens, shutter and readout options into the sensor's configuration."""
    rolls = args.ir_line_time_s or args.rgb_line_time_s
    if args.readout is not None and not rolls:
        raise CommandError(
            f"--readout {args.readout} is of a rolling shutter: give --ir-line-time-s or --rgb-line-time-s as well"
        )
    own = ("ir_distortion", "rgb_distortion", "ir_line_time_s", "rgb_line_time_s", "rgb_exposure_s")
    values = {name: getattr(args, name) for name in own} | dict.fromkeys(("ir_readout", "rgb_readout"), args.readout)
    for name, value in values.items():
        if value is not None:
            setattr(config, name, value)


def _lens(text: str) -> tuple[float, ...]:
    values = numbers(text, (4, 5, 8), "a lens")
    return tuple(map(float, np.pad(values, (0, max(0, 5 - len(values))))))


def _fisheye(text: str) -> tuple[float, ...]:
    return tuple(map(float, numbers(text, (4,), "a fisheye lens")))


def _twist(text: str) -> np.ndarray:
    values = numbers(text, (3, 6), "a velocity")
    if np.abs(values).max() >= 1e6:
        raise argparse.ArgumentTypeError(f"a velocity is in m/s and rad/s, below 1e6, not '{text}'")
    return np.concatenate([values, np.zeros(6 - len(values))])
