# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo pair`: measures properties of a real sensor on one infrared pair, without a known scene."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import simsense
from activestereo.capture.images import read_gray
from activestereo.cli import arguments as cli
from activestereo.common.output_files import write_json
from activestereo.common.pose import rigid_motion
from activestereo.common.shown import printable

_TEXT = """\
States what one rectified infrared pair of a real sensor tells without a known
scene, each with its 95 % interval: saturated pixels, gain and offset of the right
camera against the left, how far its rows lie off, and, beside the device's own depth,
by how much f x baseline or the disparity is off. Prints the table and writes
DIR/pair.json.

example, the D435 pair of SimSense's tests:
  activestereo pair left.png right.png --k 427.12,0,426.93,0,427.12,234.78,0,0,1 \\
      --baseline 0.05 --device-depth device_depth_mm.png --out out/pair
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "pair", "state what a real infrared pair tells of its sensor", _TEXT, run)
    parser.add_argument("left", type=Path, metavar="LEFT.png", help="left image, 8-bit or 16-bit gray")
    parser.add_argument("right", type=Path, metavar="RIGHT.png", help="right image of the same size; rows are aligned")
    cli.add_shared(parser, k={"required": True}, baseline={"required": True})
    text = "the device's own depth, 16-bit, left image; a whole number of times smaller is fine"
    parser.add_argument("--device-depth", type=Path, metavar="DEPTH.png", help=text)
    text = "metres per unit of it (default: 0.001)"
    parser.add_argument("--depth-scale", type=cli.depth_scale, metavar="M", help=text)
    cli.add_shared(parser, out=True, json=True)


def run(args: argparse.Namespace) -> None:
    from activestereo.compare.pair_findings import findings_text, pair_findings

    if args.depth_scale is not None and args.device_depth is None:
        raise cli.CommandError("--depth-scale is the unit of --device-depth, which is not given")
    left, right = (read_gray(path, key="image") for path in (args.left, args.right))
    if left.shape != right.shape or left.dtype != right.dtype:
        named = ((args.left, left), (args.right, right))
        kinds = ", ".join(f"{path} is {image.shape[::-1]} {image.dtype}" for path, image in named)
        raise cli.CommandError(f"the images differ: {kinds}")
    device = None if args.device_depth is None else _device_disparity(args, left.shape)
    gain = 1.0 if left.dtype == np.uint8 else 255.0 / max(left.max(), right.max(), 1)
    camera = simsense.Camera(left.shape[1], left.shape[0], args.k)
    left_to_right = rigid_motion((-args.baseline, 0.0, 0.0))
    engine = simsense.Engine(simsense.Device("host"), camera, camera, left_to_right, rectified=True, gain=gain)
    disparity = np.maximum(engine.compute(left, right, ("disparity",))["disparity"], 0.0)
    findings = pair_findings(left, right, disparity, float(np.iinfo(left.dtype).max), device)
    cli.make_folder(args.out)
    entries = {"findings": [vars(f) | {"stands_out": f.stands_out} for f in findings]}
    write_json(args.out / "pair.json", entries)
    if args.json:
        cli.print_json(entries)
        return
    print(findings_text(findings))
    print(f"written: pair.json in {printable(args.out)}")


def _device_disparity(args: argparse.Namespace, shape: tuple[int, ...]) -> np.ndarray:
    """Reads --device-depth as disparity in pixels of the left image, 0 = none. shape: the left image's."""
    depth = read_gray(args.device_depth, key="depth")
    if depth.dtype != np.uint16:
        raise cli.CommandError(f"{args.device_depth} has 8 bits, depth has 16: is it a picture?")
    step = shape[0] // depth.shape[0] if depth.shape[0] else 0
    if step < 1 or (depth.shape[0] * step, depth.shape[1] * step) != shape:
        sizes = f"{depth.shape[1]}x{depth.shape[0]}, the images are {shape[1]}x{shape[0]}"
        raise cli.CommandError(f"{args.device_depth} is {sizes}: not a whole number of times smaller")
    metres, out = depth * (args.depth_scale or 0.001), np.zeros(shape)
    np.divide(args.k[0, 0] * args.baseline, metres, out=out[::step, ::step], where=metres > 0)
    return out
