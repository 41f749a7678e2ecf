# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo depth`: computes depth from an image pair, and warns of exchanged cameras or cut-off
depth."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.cli import depth_recording
from activestereo.cli.arguments import CommandError, Commands, add_shared, make_folder, print_json
from activestereo.cli.depth_maps import (
    add_depth_maps,
    matching_line,
    matching_words,
    stage_table,
    wanted_maps,
    write_maps,
)
from activestereo.cli.engine_options import add_matching, given_parameters
from activestereo.cli.import_calibration import RectifiedPair, folder_device, rectified_pair
from activestereo.common.parameter import MATCHER, RIG

if TYPE_CHECKING:
    import simsense

# Settings for real pictures, tuned on pairs with truth (tests/bench/README.md, "Pairs with truth"). The engine's
# defaults, those of the published SimSense, err more on both kinds of pictures.
PROFILES: dict[str, dict[str, Any]] = {
    "active": {"p1": 12, "p2": 32, "subpixel": "lucas_kanade", "median_size": 5, "uniqueness_ratio": 10},
    "passive": {
        "census_kind": "plain", "census_contrast": 1 / 128, "block_width": 5, "block_height": 5,
        "p1": 12, "p2": 48, "p2_full_gradient_dn": 24,
        "subpixel": "equiangular_summed", "median_size": 5, "uniqueness_ratio": 5,
    },
}  # fmt: skip


def profile(name: str, bits: int) -> dict[str, Any]:
    """Returns the depth engine's parameters of a profile in PROFILES, scaled for images of `bits` bits per pixel."""
    found = dict(PROFILES.get(name, {}))
    if "p2_full_gradient_dn" in found:
        found["p2_full_gradient_dn"] <<= bits - 8  # PROFILES states it in 8-bit counts
    return found


_TEXT = """\
Computes depth from a rectified infrared (or gray) image pair, as a depth camera does inside.

Writes into DIR:
  depth.png      uint16 millimetres in the left camera, 0 = no measurement
  depth.npy      the same as float32 metres, without steps
  disparity.npy  float32 pixels, 0 = no measurement
  disparity.png  in colours
  cloud.ply      points, metres (x right, y down, z forward)
  overview.png   all on one page

A recording, a bag or a folder as for 'activestereo import', is matched pair by pair
as its camera would under a D400's advanced-mode settings: 16-bit PNG files in the
settings' units, and depth.json. A run that was interrupted goes on where it ended.

example, a RealSense D435's pair; a D415's recording under other settings:
  activestereo depth left.png right.png --k 427.12,0,426.93,0,427.12,234.78,0,0,1 \\
      --baseline 0.05 --out out/depth
  activestereo depth 20260101_120000.bag --settings high_accuracy.json --out out/depth
  activestereo depth 20260101_120000.bag --search noise quiet.json
"""


def add_parser(commands: Commands) -> None:
    parser = commands.add_parser("depth", help="compute depth from an image pair", description=_TEXT)
    text = "left image, 8-bit or 16-bit gray; or .npy; or, alone, a recording: a folder of PNG files or a bag"
    parser.add_argument("left", type=Path, metavar="LEFT.png|RECORDING", help=text)
    text = "right image of the same size; rows are aligned"
    parser.add_argument("right", type=Path, nargs="?", metavar="RIGHT.png", help=text)
    add_shared(parser, calibration=" in place of --k", rectified=True, k=" of both images", k_right=True)
    add_shared(parser, baseline=", where no file tells it")
    add_shared(parser, out={"required": False})
    depth_recording.add_options(parser)
    add_shared(parser, json=True, verbose="how it was matched, and times of the stages")
    text = (
        "values of the options below that are not given: active for pictures of dots, passive for plain pictures of "
        "textured things, engine for the engine's own defaults (default: active)"
    )
    parser.add_argument("--profile", choices=("engine", *PROFILES), default="active", help=text)
    text = (
        "Vulkan device for --back-end vulkan: the best one, lavapipe, or number N of 'activestereo doctor' (default: "
        "none, the CPU)"
    )
    parser.add_argument("--device", metavar="auto|cpu|N", help=text)
    add_depth_maps(add_matching(parser, PROFILES["active"]))
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    if args.right is None:
        depth_recording.run(args)
        return
    needed = ("out",) if args.calibration else ("k", "baseline", "out")
    missing = [option for option in needed if getattr(args, option) is None]
    if missing:
        raise CommandError(
            f"a pair of images needs {', '.join(f'--{option}' for option in missing)}"
            + (" (or --calibration FILE)" if "k" in missing or "baseline" in missing else "")
        )
    if args.settings or args.search or args.truth:
        raise CommandError("--settings, --search and --truth are for recordings, not for a pair")
    from activestereo.capture.images import read_image_array

    left, right = (read_image_array(path, key="image") for path in (args.left, args.right))
    if left.shape != right.shape:
        sizes = " and ".join(f"{image.shape[1]}x{image.shape[0]}" for image in (left, right))
        raise CommandError(f"the images differ in size: {args.left} and {args.right} are {sizes}")
    if left.dtype != right.dtype:
        bits = " and ".join(str(8 * image.itemsize) for image in (left, right))
        raise CommandError(f"the images differ in depth: {args.left} and {args.right} have {bits} bits")
    size = left.shape[1], left.shape[0]
    cameras = rectified_pair(folder_device(args, size)[0], *size)
    engine = _make_engine(args, cameras, left)
    make_folder(args.out)
    from activestereo.common.progress_bar import ProgressBar

    with ProgressBar(f"matching {left.shape[1]}x{left.shape[0]}") as bar:
        result = engine.compute(left, right, ("depth", "disparity", "points", *wanted_maps(args)), progress=bar)
    _write(args, left, right, result)
    _report(args, cameras, engine, result["depth"], depth_hints(cameras, engine, left, right, result))


def _make_engine(args: argparse.Namespace, cameras: RectifiedPair, left: np.ndarray) -> simsense.Engine:
    import simsense

    height, width = left.shape
    left_camera, right_camera = (simsense.Camera(width, height, K) for K in (cameras.left_K, cameras.right_K))
    left_to_right = np.eye(4)
    left_to_right[0, 3] = -cameras.baseline_m
    bits = 8 * left.itemsize  # the matcher uses all bits of 8-bit and of 16-bit images
    options = profile(args.profile, bits) | given_parameters(args, MATCHER, RIG)
    # A Vulkan device is opened only on request, so that a plain call needs no driver.
    device = args.device or ("auto" if options.get("back_end") == "vulkan" else "host")
    return simsense.Engine(
        simsense.Device(device), left_camera, right_camera, left_to_right, rectified=True, bit_depth=bits, **options
    )


def _write(args: argparse.Namespace, left: np.ndarray, right: np.ndarray, result: Mapping[str, np.ndarray]) -> None:
    from activestereo.common.output_files import replace_file, write_depth_png, write_ply, write_png, written_together
    from activestereo.report.lettering import write_figure
    from activestereo.report.overview import colored, depth_span, matching_figure

    depth, disparity = result["depth"], result["disparity"]
    with written_together(args.out) as out:
        write_depth_png(out / "depth.png", depth)
        replace_file(out / "depth.npy", lambda file: np.save(file, depth.astype(np.float32)))
        replace_file(out / "disparity.npy", lambda file: np.save(file, np.maximum(disparity, 0.0).astype(np.float32)))
        shown = np.where(disparity > 0, disparity, 0.0)
        write_png(out / "disparity.png", colored(shown, depth_span(shown), "turbo"))
        write_ply(out / "cloud.ply", result["points"][depth > 0])
        write_maps(out, {name: result[name] for name in wanted_maps(args)})
        title = f"Depth from {args.left.name} and {args.right.name}"
        write_figure(out / "overview.png", matching_figure(title, left, right, disparity, depth))


def _report(
    args: argparse.Namespace, cameras: RectifiedPair, engine: simsense.Engine, depth: np.ndarray, hints: list[str]
) -> None:
    from activestereo.report.screen import command, screen

    valid = depth[depth > 0]
    share, median_m = valid.size / depth.size, float(np.median(valid)) if valid.size else None
    stages_ms = {"depth": dict(engine.stage_times)}
    if args.json:
        found = {"measured_share": share, "median_depth_m": median_m, "hints": hints}
        print_json({"matching": matching_words(engine), "stages_ms": stages_ms} | found)
        return
    middle = "" if median_m is None else f", in the median {median_m:.3f} m"
    sentence = f"{100.0 * share:.1f} % of {depth.shape[1]}x{depth.shape[0]} pixels have depth{middle}."
    K = ",".join(f"{value:.10g}" for value in cameras.left_K[[0, 1, 0, 1], [0, 1, 2, 2]])
    rig = "--k", K, "--baseline", f"{cameras.baseline_m:.10g}", "-o", args.out / "pair"
    leads = [] if cameras.offset_px else [command("pair", args.left, args.right, *rig)]
    details = f"{matching_line(engine)}\n{stage_table(stages_ms)}"
    print(screen(sentence, (), hints, leads, args.out / "overview.png", details, args.verbose))


# The cameras are exchanged if the exchanged pair matches _TIMES as many pixels and at least _LEAST_FILL of the image.
_TIMES = 1.5
_SUSPICIOUS_FILL = 0.6
_LEAST_FILL = 0.5


def depth_hints(
    cameras: RectifiedPair, engine: simsense.Engine, left: np.ndarray, right: np.ndarray,
    result: Mapping[str, np.ndarray],
) -> list[str]:  # fmt: skip
    """Returns warnings about dropped depth and exchanged images, an empty list if there are none. result: the engine's
    depth in metres and disparity in pixels."""
    hints, disparity, p = [], result["disparity"], engine.parameters
    # A matched pixel without depth lies outside of the range of depths that the engine keeps.
    lost = (disparity > 0) & (result["depth"] == 0)
    z = cameras.focal_baseline_px_m / np.where(lost, disparity + cameras.offset_px, 1.0)
    far, near = int((lost & (z >= p["max_depth_m"])).sum()), int((lost & (z < p["min_depth_m"])).sum())
    parts = [
        f"{count} pixels {words}, {100.0 * count / disparity.size:.1f} %, were dropped ({option} {p[name]:g})"
        for count, words, option, name in (
            (far, f"from {p['max_depth_m']:g} m on", "--max-depth-m", "max_depth_m"),
            (near, f"nearer than {p['min_depth_m']:g} m", "--min-depth-m", "min_depth_m"),
        )
        if count
    ]
    if parts:
        hints.append("cut off: " + "; ".join(parts))
    # If few pixels match, the exchanged pair is tried.
    fill = float((disparity > 0).mean())
    if fill < _SUSPICIOUS_FILL:
        other = float((engine.compute(right, left, ("disparity",))["disparity"] > 0).mean())
        if other >= max(_LEAST_FILL, _TIMES * fill):
            shares = f"{100 * other:.1f} % instead of {100 * fill:.1f} %"
            hints.append(f"hint: exchanged, the images give {shares}: is LEFT the right camera's image?")
    return hints
