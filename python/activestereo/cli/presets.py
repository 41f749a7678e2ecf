# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo presets`: prints the known cameras, and each of their figures with its source."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from activestereo.camera.camera_file import FIELDS, CameraData, Figure, camera_names, read_camera
from activestereo.cli import arguments as cli
from activestereo.common.text_table import columns

_TEXT = """\
Prints the cameras that the simulator knows, and of one camera every figure with
its unit, what it rests on and where it was found:
  data sheet   the maker's data sheet or librealsense's options
  measured     measured on recordings of such a camera
  published    in a paper or another program's source
  derived      computed from the others
  estimated    a guess; no measurement is known

A camera of your own is a .toml file of this form, based_on one of these; simulate
--sensor and StereoDepthSensorConfig take its path.

examples:
  activestereo presets
  activestereo presets d435i
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "presets", "print the known cameras and their figures' sources", _TEXT, run)
    parser.add_argument("name", nargs="?", metavar="NAME", help="a camera, or the path of a .toml file (default: all)")
    cli.add_shared(parser, json=True)


def run(args: argparse.Namespace) -> None:
    cameras = [read_camera(name) for name in ([args.name] if args.name else camera_names())]
    if args.json:
        cli.print_json([asdict(camera) for camera in cameras])
    elif args.name:
        print(_figures(cameras[0]))
    else:
        print(_table(cameras))


def _table(cameras: list[CameraData]) -> str:
    rows = [("name", "images", "f px", "baseline", "laser", "black", "exposure")]
    for camera in cameras:
        width, height = camera.value("rig", "ir_resolution")
        left, right = (camera.value("rig", f"{side}_position_m") for side in ("left", "right"))
        baseline_mm = 1e3 * sum((a - b) ** 2 for a, b in zip(left, right, strict=True)) ** 0.5
        has_laser = camera.value("projector", "has_projector", True)
        rows.append((
            camera.name, f"{width}x{height}", f"{camera.value('rig', 'ir_intrinsic')[0]:.1f}", f"{baseline_mm:.1f} mm",
            f"{camera.value('projector', 'laser_power_mw'):.0f} mW" if has_laser else "none",
            f"{camera.value('imager', 'black_level_dn'):g} DN", camera.value("exposure", "mode"),
        ))  # fmt: skip
    return columns(rows)


def _figures(camera: CameraData) -> str:
    lines = [f"{camera.name}: {camera.title}"]
    for section, figures in camera.figures.items():
        lines += ["", f"[{section}]"] if figures else []
        for name, figure in figures.items():
            field = FIELDS[section][name]
            lines.append(f"{name} = {_value(figure)} {field.unit}".rstrip() + f"   ({field.doc})")
            lines.append(f"    {figure.basis}: {figure.source}")
    estimated = sum(figure.basis == "estimated" for section in camera.figures.values() for figure in section.values())
    return "\n".join([*lines, "", f"{estimated} of {sum(map(len, camera.figures.values()))} figures are estimated"])


def _value(figure: Figure) -> str:
    value: Any = figure.value
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(f"{part:.6g}" for part in value)
    return value if isinstance(value, str) else f"{value:.6g}"
