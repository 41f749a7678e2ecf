# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo depth-quality`: computes Intel's depth quality metrics on frames of a flat target."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

import numpy as np

from activestereo.capture.images import read_gray
from activestereo.cli import arguments as cli
from activestereo.common.input_files import checked_file

_TEXT = """\
Measures depth maps of a flat target by the metrics of Intel's Depth Quality Tool, under
their names: fill rate, Z accuracy, plane fit RMS error, subpixel RMS error and, with two
or more frames of the same view, temporal noise (the tool takes 40).

DEPTH is a 16-bit PNG in millimetres (--unit changes that), or a .npy of metres, as
`depth` writes it; 0 = no measurement. A .npy may hold many frames. Noise below a
PNG's step cannot be seen in it: where that may be so it is said, and float depth is
what to give.

example, the plane that a simulated D435 saw 0.8 m away:
  activestereo depth-quality out/depth.png --k 430.14,430.14,425.16,235.28 --baseline 0.05 --truth 0.8
"""

FARTHEST_M = 1e6
# A file whose depth steps exceed this hides the noise of stereo matching.
_COARSE_STEP_PX = 0.05


def add_parser(commands: cli.Commands) -> None:
    text = "measure depth maps of a flat target by Intel's metrics"
    parser = cli.add_command(commands, "depth-quality", text, _TEXT, run)
    parser.add_argument("depth", type=Path, nargs="+", metavar="DEPTH", help="depth maps of one size: PNG or .npy")
    text = "camera matrix of the depth maps in pixels; or short: fx,fy,cx,cy"
    cli.add_shared(parser, k={"required": True, "metavar": "fx,0,cx,0,fy,cy,0,0,1", "help": text})
    cli.add_shared(parser, baseline={"required": True})
    text = "true distance of the target along the optical axis, metres"
    parser.add_argument("--truth", type=cli.positive, metavar="M", help=text)
    text = "centred part of height and width, 0..1 (default %(default)s)"
    parser.add_argument("--roi", type=cli.positive, default=0.4, metavar="FRACTION", help=text)
    text = "metres per step of a PNG (default %(default)s)"
    parser.add_argument("--unit", type=cli.positive, default=0.001, metavar="M", help=text)
    cli.add_shared(parser, json=True)


def run(args: argparse.Namespace) -> None:
    from activestereo.compare.depth_quality import depth_quality, quality_table, region_of

    if args.roi > 1:
        raise cli.CommandError(f"--roi is {args.roi:g}: a fraction of the image, 0..1")
    frames = _read_all(args)
    quality = depth_quality(frames, args.k, args.baseline, args.truth, region_of(frames.shape[1:], args.roi))
    if args.json:
        cli.print_json({"frames": len(frames)} | asdict(quality))
        return
    count, (height, width) = f"{len(frames)} frame{'s' * (len(frames) > 1)}", frames.shape[1:]
    print(f"{count} of {width}x{height}, central {100 * args.roi:.0f} %")
    print(quality_table(quality))
    if hint := _steps(args, frames):
        print(hint)


def _steps(args: argparse.Namespace, frames: np.ndarray) -> str | None:
    """Returns a note if the depth file's rounding is coarse against stereo noise (1/20 px), else None. frames: metres,
    0 = none."""
    measured = frames[frames > 0]
    if not measured.size or all(path.suffix == ".npy" for path in args.depth):
        return None
    step_px = args.k[0, 0] * args.baseline * args.unit / float(np.median(measured)) ** 2
    if step_px < _COARSE_STEP_PX:
        return None
    return (
        f"note: the file's steps of {1e3 * args.unit:g} mm are {step_px:.3f} px here; noise below about half of that "
        "reads as zero: give float depth (.npy), as 'activestereo depth' writes it"
    )


def _read_all(args: argparse.Namespace) -> np.ndarray:
    parts = [_read(path, args.unit) for path in args.depth]
    for path, part in zip(args.depth, parts, strict=True):
        if part.shape[1:] != parts[0].shape[1:]:
            first, other = (f"{p.shape[2]}x{p.shape[1]}" for p in (parts[0], part))
            raise cli.CommandError(f"the depth maps differ in size: {args.depth[0]} is {first}, {path} is {other}")
    return np.concatenate(parts)


def _read(path: Path, unit_m: float) -> np.ndarray:
    """Reads a depth file (.png or .npy) as metres, [frames, height, width]. unit_m: metres per unit of the file."""
    if path.suffix != ".npy":
        return read_gray(path, key="depth")[None] * unit_m
    try:
        # Memory-mapped, so that a header that claims more than the file holds fails before memory is allocated.
        depth = np.load(checked_file(path), mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, OverflowError, EOFError) as error:
        raise cli.CommandError(f"{path}: cannot be read as a .npy array: {error}") from error
    if depth.ndim not in (2, 3) or depth.dtype.kind not in "fiu":
        raise cli.CommandError(
            f"{path}: is {depth.dtype} {depth.shape}, expected numbers [height, width] or [frames, height, width]"
        )
    metres = np.nan_to_num(depth.reshape(-1, *depth.shape[-2:]), posinf=0.0, neginf=0.0)
    if metres.size and np.abs(metres).max() > FARTHEST_M:
        raise cli.CommandError(
            f"{path}: holds a depth of {np.abs(metres).max():g} m, at most {FARTHEST_M:g} m is a depth"
        )
    return metres
