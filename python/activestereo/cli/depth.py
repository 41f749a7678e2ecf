# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo depth`: computes depth from an image pair, or from every infrared pair of a recording. Warns
if the images seem exchanged or if the range of depths cuts off pixels."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import simsense
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import read_capture
from activestereo.capture.images import read_gray, read_npy
from activestereo.cli import arguments as cli
from activestereo.cli import sensor_options as options
from activestereo.cli.import_calibration import RectifiedPair, folder_device, own_device, rectified_pair
from activestereo.common.input_files import read_json_object
from activestereo.common.output_files import (
    replace_file,
    write_depth_png,
    write_ply,
    write_png,
    write_text,
    written_together,
)
from activestereo.common.parameter import MATCHER, RIG
from activestereo.common.pose import rigid_motion
from activestereo.common.progress_bar import ProgressBar
from activestereo.common.shown import counted
from activestereo.report.lettering import write_figure
from activestereo.report.screen import Figure, command, screen

if TYPE_CHECKING:
    from activestereo.camera.advanced_mode.settings import DepthTable
    from activestereo.capture.importers.bag import Pair

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
# Parameters that the profiles and the presets state for images of 8 bits.
_IN_COUNTS_OF_8_BITS = ("p2_full_gradient_dn", "min_texture_dn", "low_texture_dn", "census_noise_dn")
_DISPARITY_STEPS = 32  # of a pixel, the step of disparities in a D400's images
_RUN = "depth.json"

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
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "depth", "compute depth from an image pair", _TEXT, run)
    text = "left image, 8-bit or 16-bit gray; or .npy; or, alone, a recording: a folder of PNG files or a bag"
    parser.add_argument("left", type=Path, metavar="LEFT.png|RECORDING", help=text)
    text = "right image of the same size; rows are aligned"
    parser.add_argument("right", type=Path, nargs="?", metavar="RIGHT.png", help=text)
    cli.add_shared(parser, calibration=" in place of --k", rectified=True, k=" of both images", k_right=True)
    cli.add_shared(parser, baseline=", where no file tells it")
    cli.add_shared(parser, out={"required": False})
    recordings = "recordings", "One argument in place of LEFT and RIGHT: a folder or a bag."
    add = parser.add_argument_group(*recordings).add_argument
    text = "advanced-mode settings of a D400, as Intel's Viewer writes them (default: the camera's own)"
    add("--settings", type=Path, metavar="FILE.json", help=text)
    text = "the camera whose matcher and nominal figures are taken (default: d415)"
    add("--sensor", metavar="NAME", help=text)
    cli.add_shared(parser, json=True, verbose="how it was matched, and times of the stages")
    text = "values of the options below that are not given: active for pictures of dots, passive for plain pictures of "
    text += "textured things, engine for the engine's own defaults (default: active)"
    parser.add_argument("--profile", choices=("engine", *PROFILES), help=text)
    text = "Vulkan device for --back-end vulkan: the best one, lavapipe, or number N of 'activestereo doctor' "
    parser.add_argument("--device", metavar="auto|cpu|N", help=f"{text}(default: none, the CPU)")
    options.add_matching(parser, PROFILES["active"])


def run(args: argparse.Namespace) -> None:
    """Computes an image pair's depth, writes it and prints the result; a recording goes to _run_recording()."""
    if args.right is None:
        cli.refuse(args, ("profile", "confidence", "reason"), "for a pair of images, not for a recording")
        args.sensor = args.sensor or "d415"
        _run_recording(args)
        return
    cli.refuse(args, ("settings", "sensor"), "for recordings, not for a pair of images")
    args.sensor = "d415"  # its nominal figures are not used
    from activestereo.report.pictures import colored, depth_span, matching_figure

    needed = ("out",) if args.calibration else ("k", "baseline", "out")
    missing = [option for option in needed if getattr(args, option) is None]
    if missing:
        or_file = " (or --calibration FILE)" if "k" in missing or "baseline" in missing else ""
        raise cli.CommandError(f"a pair of images needs {', '.join(f'--{option}' for option in missing)}{or_file}")
    left, right = (
        read_npy(path, "image", "height", "width") if path.suffix == ".npy" else read_gray(path, key="image")
        for path in (args.left, args.right)
    )
    if left.shape != right.shape:
        sizes = " and ".join(f"{image.shape[1]}x{image.shape[0]}" for image in (left, right))
        raise cli.CommandError(f"the images differ in size: {args.left} and {args.right} are {sizes}")
    if left.dtype != right.dtype:
        depths = " and ".join(str(8 * image.itemsize) for image in (left, right))
        raise cli.CommandError(f"the images differ in depth: {args.left} and {args.right} have {depths} bits")
    height, width = left.shape
    cameras = rectified_pair(folder_device(args, (width, height))[0], width, height)
    given = options.given_parameters(args, MATCHER, RIG)
    engine = _engine(args, cameras, left, PROFILES.get(args.profile or "active", {}), given)
    cli.make_folder(args.out)
    with ProgressBar(f"matching {width}x{height}") as bar:
        result = engine.compute(left, right, ("depth", "disparity", "points", *options.wanted_maps(args)), progress=bar)
    depth, disparity = result["depth"], result["disparity"]
    with written_together(args.out) as out:
        write_depth_png(out / "depth.png", depth)
        replace_file(out / "depth.npy", lambda file: np.save(file, depth.astype(np.float32)))
        replace_file(out / "disparity.npy", lambda file: np.save(file, np.maximum(disparity, 0.0).astype(np.float32)))
        shown = np.where(disparity > 0, disparity, 0.0)
        write_png(out / "disparity.png", colored(shown, depth_span(shown), "turbo"))
        write_ply(out / "cloud.ply", result["points"][depth > 0])
        options.write_maps(out, {name: result[name] for name in options.wanted_maps(args)})
        title = f"Depth from {args.left.name} and {args.right.name}"
        write_figure(out / "overview.png", matching_figure(title, left, right, disparity, depth))
    hints = depth_hints(cameras, engine, left, right, result)
    valid = depth[depth > 0]
    share, median_m = valid.size / depth.size, float(np.median(valid)) if valid.size else None
    stages_ms = {"depth": dict(engine.stage_times)}
    if args.json:
        found = {"measured_share": share, "median_depth_m": median_m, "hints": hints}
        cli.print_json({"matching": options.matching_words(engine), "stages_ms": stages_ms} | found)
        return
    middle = "" if median_m is None else f", in the median {median_m:.3f} m"
    sentence = f"{100.0 * share:.1f} % of {width}x{height} pixels have depth{middle}."
    K = ",".join(f"{value:.10g}" for value in cameras.left_K[[0, 1, 0, 1], [0, 1, 2, 2]])
    rig = "--k", K, "--baseline", f"{cameras.baseline_m:.10g}", "-o", args.out / "pair"
    leads = [] if cameras.offset_px else [command("pair", args.left, args.right, *rig)]
    details = f"{options.matching_line(engine)}\n{options.stage_table(stages_ms)}"
    print(screen(sentence, (), hints, leads, args.out / "overview.png", details, args.verbose))


def _engine(
    args: argparse.Namespace, cameras: RectifiedPair, image: np.ndarray, base: Mapping[str, Any],
    given: Mapping[str, Any],
) -> simsense.Engine:  # fmt: skip
    """Returns a depth engine for pairs of the image's size and bits, all of which it uses. base: its parameters for
    images of 8 bits. given: those of the options, which replace them. A Vulkan device is opened only on request, so
    that a plain call needs no driver."""
    (height, width), bits = image.shape, 8 * image.itemsize
    own = {name: value << (bits - 8) if name in _IN_COUNTS_OF_8_BITS else value for name, value in base.items()}
    device = simsense.Device(args.device or ("auto" if given.get("back_end") == "vulkan" else "host"))
    left, right = (simsense.Camera(width, height, K) for K in (cameras.left_K, cameras.right_K))
    left_to_right = rigid_motion((-cameras.baseline_m, 0.0, 0.0))
    return simsense.Engine(device, left, right, left_to_right, rectified=True, bit_depth=bits, **(own | given))


# The images are exchanged if the swapped pair gives depth to _TIMES as many pixels and at least _LEAST_FILL of them.
_TIMES = 1.5
_SUSPICIOUS_FILL = 0.6
_LEAST_FILL = 0.5


def depth_hints(
    cameras: RectifiedPair, engine: simsense.Engine, left: np.ndarray, right: np.ndarray,
    result: Mapping[str, np.ndarray],
) -> list[str]:  # fmt: skip
    """Returns warnings about pixels outside of the range of depths and about exchanged images; an empty list if there
    are none. result: the engine's depth in metres and disparity in pixels."""
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
    # If few pixels have depth, the exchanged pair is tried. Disparities near 0, which chance gives it, do not count.
    fill = float((result["depth"] > 0).mean())
    if fill < _SUSPICIOUS_FILL:
        other = float((engine.compute(right, left, ("depth",))["depth"] > 0).mean())
        if other >= max(_LEAST_FILL, _TIMES * fill):
            shares = f"{100 * other:.1f} % instead of {100 * fill:.1f} %"
            hints.append(f"hint: exchanged, the images give {shares}: is LEFT the right camera's image?")
    return hints


def _run_recording(args: argparse.Namespace) -> None:
    """Computes depth of all pairs of the recording that have none yet, and prints the result."""
    from activestereo.camera.advanced_mode.settings import (
        AdvancedSettings,
        depth_table,
        matcher_parameters,
        read_settings,
    )
    from activestereo.camera.plan import matcher_parameters as matcher_of
    from activestereo.capture.importers.bag import count_pairs, is_bag, recorded_pairs
    from activestereo.capture.importers.realsense_folder import frame_files

    settings = AdvancedSettings({}) if args.settings is None else read_settings(args.settings)
    if args.out is None:
        raise cli.CommandError("the following arguments are required: -o/--out")
    recording, out = args.left.resolve(), args.out.resolve()
    is_inside = recording in (out, *out.parents) if recording.is_dir() else out == recording.parent
    if is_inside:
        told = "lies in the recording, which is never written: choose a folder outside of it"
        raise cli.CommandError(f"--out {args.out} {told}")
    if not args.left.is_dir() and not is_bag(args.left):
        raise cli.CommandError(f"{args.left}: is neither a folder nor a bag; of a pair of images give both")
    first = next(recorded_pairs(args.left), None)
    if first is None:
        raise cli.CommandError(f"{args.left}: no infrared pair: its two streams have no images of one time")
    cameras, assumed = _geometry(args, first)
    cli.make_folder(args.out)
    table = depth_table(settings)
    base = matcher_parameters(settings, matcher_of(StereoDepthSensorConfig(args.sensor)))
    base |= {"min_depth_m": table.min_depth_m, "max_depth_m": table.max_depth_m}
    engine = _engine(args, cameras, first.left, base, options.given_parameters(args, MATCHER, RIG))
    done = {path.stem for path in args.out.glob("*.png")}
    facts = {  # all depth images of one folder share them
        "recording": args.left.name, "size": [first.left.shape[1], first.left.shape[0]],
        "K": cameras.left_K.ravel().tolist(), "offset_px": cameras.offset_px, "baseline_m": cameras.baseline_m,
        "table": asdict(table), "settings": dict(settings.values),
        "matcher": {name: value for name, value in engine.parameters.items() if name != "frame_index"},
    }  # fmt: skip
    _same_run(args.out / _RUN, bool(done), facts)
    fills, count = dict[str, float](), count_pairs(args.left) if is_bag(args.left) else len(frame_files(args.left))
    with ProgressBar(f"matching {args.left.name}") as bar:
        for pair in recorded_pairs(args.left, lambda name: name not in done):
            image = _image(engine, table, pair)
            write_png(args.out / f"{pair.name}.png", image)
            fills[pair.name] = float(np.mean(image > 0))
            bar(min(1.0, (len(done) + len(fills)) / max(1, count)))
    number, share = len(fills), sum(fills.values()) / len(fills) if fills else None
    unmapped = settings.unmapped()
    if args.json:
        found = {"pairs": number, "done_before": len(done), "measured_share": share, "unmapped": unmapped}
        cli.print_json(found | {"assumed": assumed, "out": str(args.out)})
        return
    notes = [f"without effect here: {', '.join(unmapped)}"] if unmapped else []
    notes += [f"assumed: {line}" for line in assumed]
    before = f", {len(done)} were there already" if done else ""
    measured = "" if share is None else f"; {100 * share:.1f} % of the pixels have depth"
    sentence = f"{counted(number, 'pair')} matched{before}{measured}. 16-bit depth is in {args.out}."
    order = sorted(fills, key=lambda name: fills[name])
    ends = (("least", order[0]), ("most", order[-1])) if number > 1 else ()
    figures = [Figure(f"{which}: {name}", f"{100 * fills[name]:.1f} %", fills[name]) for which, name in ends]
    print(screen(sentence, figures, notes, [command("view", args.left)], args.out / _RUN, verbose=args.verbose))


def _geometry(args: argparse.Namespace, first: Pair) -> tuple[RectifiedPair, list[str]]:
    """Returns the recording's rectified cameras, and lines that state the assumptions. first: the first pair."""
    from activestereo.capture.importers.bag import is_bag, read_calibration
    from activestereo.capture.importers.realsense_text import DeviceText

    height, width = first.left.shape
    assumed: list[str] = []
    if is_bag(args.left):
        device = own_device(args, args.left, (width, height)) or read_calibration(args.left, args.baseline)
    elif (stated := args.left / "capture.json").is_file():
        rig = read_capture(args.left).rig
        own = DeviceText.of_pair(stated, (rig.left, rig.right), rig.left_to_right)
        device = own_device(args, stated, (width, height)) or own
    else:
        device, assumed = folder_device(args, (width, height))
    return rectified_pair(device, width, height), assumed


def _image(engine: simsense.Engine, table: DepthTable, pair: Pair) -> np.ndarray:
    """Returns the pair's depth image in the camera's format, uint16, 0 = no measurement. Values are depths in units of
    the depth table, or disparities in 1/32 pixel if the table says so."""
    name, unit = ("disparity", 1.0 / _DISPARITY_STEPS) if table.is_disparity else ("depth", table.unit_m)
    values = np.maximum(np.asarray(engine.compute(pair.left, pair.right, (name,))[name], np.float64), 0.0)
    return np.clip(np.rint(values / unit), 0, np.iinfo(np.uint16).max).astype(np.uint16)


def _same_run(path: Path, has_images: bool, facts: Mapping[str, Any]) -> None:
    """Checks that a folder's earlier depth images are of a run with these facts. path: the folder's record of them,
    written here if it is new. Raises CommandError for other facts, or if has_images is true and there is no record."""
    text = json.dumps(facts, indent=1, default=str)
    if path.is_file():
        before = read_json_object(path)
        if differing := [name for name, value in json.loads(text).items() if before.get(name) != value]:
            told = f"holds depth of another run ({', '.join(differing)} differ): choose another folder"
            raise cli.CommandError(f"{path.parent}: {told}")
        return
    if has_images:
        raise cli.CommandError(f"{path.parent}: holds PNG files and no {_RUN}: choose another folder")
    write_text(path, text + "\n")
