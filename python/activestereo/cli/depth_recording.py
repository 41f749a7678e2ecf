# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo depth RECORDING`: matches every infrared pair of a recording again."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.cli.arguments import CommandError, check_out_file, make_folder, print_json
from activestereo.cli.engine_options import given_parameters
from activestereo.cli.import_calibration import RectifiedPair, folder_device, own_device, rectified_pair
from activestereo.common.parameter import MATCHER, RIG
from activestereo.report.screen import Figure, command, screen

if TYPE_CHECKING:
    from activestereo.camera.advanced_mode import AdvancedSettings
    from activestereo.camera.advanced_mode.matcher import PairMatcher
    from activestereo.capture.importers.pairs import Pair

_RUN = "depth.json"
_SEARCHED_PAIRS = 4
_GOALS = ("fill", "noise", "truth")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `activestereo depth` that apply to recordings alone."""
    group = parser.add_argument_group("recordings", "One argument in place of LEFT and RIGHT: a folder or a bag.")
    add = group.add_argument
    text = "advanced-mode settings of a D400, as Intel's Viewer writes them (default: the camera's own)"
    add("--settings", type=Path, metavar="FILE.json", help=text)
    text = "look for settings: most fill at the same noise, least noise at the same fill, or least error beside "
    text += "--truth; writes them for the camera"
    add("--search", nargs=2, metavar=("fill|noise|truth", "FILE.json"), help=text)
    text = "16-bit depth of the same pairs in millimetres, by name in order of the pairs: a folder of PNG files"
    add("--truth", type=Path, metavar="DIR", help=text)
    text = "the camera whose matcher and nominal figures are taken (default: d415)"
    add("--sensor", default="d415", metavar="NAME", help=text)


def run(args: argparse.Namespace) -> None:
    """Matches all pairs of the recording, or under --search looks for better settings, and prints the result."""
    from activestereo.camera.advanced_mode import AdvancedSettings, read_settings

    settings = AdvancedSettings({}) if args.settings is None else read_settings(args.settings)
    if args.search is not None:
        _search(args, settings)
        return
    if args.out is None:
        raise CommandError("the following arguments are required: -o/--out")
    recording, out = args.left.resolve(), args.out.resolve()
    is_inside = recording in (out, *out.parents) if recording.is_dir() else out == recording.parent
    if is_inside:
        told = "lies in the recording, which is never written: choose a folder outside of it"
        raise CommandError(f"--out {args.out} {told}")
    _match(args, settings)


def _match(args: argparse.Namespace, settings: AdvancedSettings) -> None:
    from activestereo.capture.importers.pairs import recorded_pairs
    from activestereo.common.output_files import write_png
    from activestereo.common.progress_bar import ProgressBar

    first = _chosen_pairs(args.left, [0])[0]
    cameras, assumed = _geometry(args, first)
    make_folder(args.out)
    matcher = _matcher(args, settings, cameras, first)
    done = {path.stem for path in args.out.glob("*.png")}
    _same_run(args.out / _RUN, bool(done), _facts(args, settings, matcher, cameras, first))
    fills, count = dict[str, float](), max(1, _count(args.left))
    with ProgressBar(f"matching {args.left.name}") as bar:
        for pair in recorded_pairs(args.left, lambda name: name not in done):
            image = matcher.image(pair.left, pair.right)
            write_png(args.out / f"{pair.name}.png", image)
            fills[pair.name] = float(np.mean(image > 0))
            bar(min(1.0, (len(done) + len(fills)) / count))
    number, share = len(fills), sum(fills.values()) / len(fills) if fills else None
    result = {
        "pairs": number,
        "done_before": len(done),
        "measured_share": share,
        "unmapped": settings.unmapped(),
        "assumed": assumed,
        "out": str(args.out),
    }
    if args.json:
        print_json(result)
        return
    unmapped = settings.unmapped()
    notes = [f"without effect here: {', '.join(unmapped)}"] if unmapped else []
    notes += [f"assumed: {line}" for line in assumed]
    before = f", {len(done)} were there already" if done else ""
    measured = "" if share is None else f"; {100 * share:.1f} % of the pixels have depth"
    sentence = f"{number} pair{'' if number == 1 else 's'} matched{before}{measured}. 16-bit depth is in {args.out}."
    order = sorted(fills, key=lambda name: fills[name])
    told = (("least", order[0]), ("most", order[-1])) if number > 1 else ()
    figures = [Figure(f"{which}: {name}", f"{100 * fills[name]:.1f} %", fills[name]) for which, name in told]
    steps = [command("view", args.left)]
    if args.settings is None:
        steps.insert(0, command(*args.given, "--search", "noise", args.out / "quiet.json"))
    print(screen(sentence, figures, notes, steps, args.out / _RUN, verbose=args.verbose))


def _geometry(args: argparse.Namespace, first: Pair) -> tuple[RectifiedPair, list[str]]:
    """Returns the recording's rectified cameras, and lines that state the assumptions about them."""
    from activestereo.capture.capture import read_capture
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


def _count(recording: Path) -> int:
    """Returns the number of infrared pairs in a folder of images or a bag."""
    from activestereo.capture.importers.bag import count_pairs, is_bag
    from activestereo.capture.importers.realsense_folder import frame_files

    return count_pairs(recording) if is_bag(recording) else len(frame_files(recording))


def _matcher(args: argparse.Namespace, settings: AdvancedSettings, cameras: RectifiedPair, pair: Pair) -> PairMatcher:
    import simsense
    from activestereo.camera.advanced_mode.matcher import PairMatcher
    from activestereo.camera.plan import matcher_parameters
    from activestereo.camera.presets import StereoDepthSensorConfig

    base = matcher_parameters(StereoDepthSensorConfig(args.sensor))
    overrides = given_parameters(args, MATCHER, RIG)
    device = args.device or ("auto" if overrides.get("back_end") == "vulkan" else "host")
    K = cameras.left_K, cameras.right_K
    return PairMatcher(K, cameras.baseline_m, pair.left, settings, base, overrides, simsense.Device(device))


def _facts(
    args: argparse.Namespace, settings: AdvancedSettings, matcher: PairMatcher, cameras: RectifiedPair, pair: Pair,
) -> dict[str, Any]:  # fmt: skip
    """Returns cameras and matcher settings of this run as JSON values for depth.json. All depth images of one folder
    must share them."""
    return {
        "recording": args.left.name,
        "size": [pair.left.shape[1], pair.left.shape[0]],
        "K": cameras.left_K.ravel().tolist(),
        "offset_px": cameras.offset_px,
        "baseline_m": cameras.baseline_m,
        "table": asdict(matcher.table),
        "settings": dict(settings.values),
        "matcher": {name: value for name, value in matcher.parameters.items() if name != "frame_index"},
    }


def _same_run(path: Path, has_images: bool, facts: Mapping[str, Any]) -> None:
    """Checks that a folder's earlier depth images are of a run with these facts (_facts()), and writes them to `path`
    if it is new. Raises CommandError for other facts, or PNG files (has_images) without the file."""
    from activestereo.common.input_files import read_json_object
    from activestereo.common.output_files import write_text

    text = json.dumps(facts, indent=1, default=str)
    if path.is_file():
        before = read_json_object(path)
        differing = [name for name, value in json.loads(text).items() if before.get(name) != value]
        if differing:
            raise CommandError(
                f"{path.parent}: holds depth of another run ({', '.join(differing)} differ): choose another folder"
            )
        return
    if has_images:
        raise CommandError(f"{path.parent}: holds PNG files and no {_RUN}: choose another folder")
    write_text(path, text + "\n")


def _search(args: argparse.Namespace, settings: AdvancedSettings) -> None:
    from activestereo.camera.advanced_mode import write_settings
    from activestereo.camera.advanced_mode.search import score, search
    from activestereo.common.progress_bar import ProgressBar

    goal, out = args.search[0], Path(args.search[1])
    if goal not in _GOALS:
        raise CommandError(f"--search {goal}: expected one of {', '.join(_GOALS)}")
    if (goal == "truth") != (args.truth is not None):
        raise CommandError("--search truth needs --truth DIR, and --truth nothing else")
    check_out_file(out)
    last = _count(args.left) - 1  # the chosen pairs spread over the whole recording
    chosen = sorted({round(share * last) for share in np.linspace(0.0, 1.0, _SEARCHED_PAIRS)})
    pairs = _chosen_pairs(args.left, chosen)
    cameras, assumed = _geometry(args, pairs[0])
    truths = [] if args.truth is None else _truths(args, chosen, cameras, pairs[0].left.shape)
    matcher = _matcher(args, settings, cameras, pairs[0])

    def evaluate(tried: AdvancedSettings) -> Any:
        matcher.set_settings(tried)
        return score([matcher.disparity(pair.left, pair.right) for pair in pairs], truths)

    with ProgressBar(f"searching on {len(pairs)} pairs") as bar:
        best, before, after = search(goal, settings, evaluate, bar)
    write_settings(out, best)
    if args.json:
        changed = {name: value for name, value in best.values.items() if settings.values.get(name) != value}
        print_json({"before": asdict(before), "after": asdict(after), "changed": changed, "assumed": assumed})
        return
    figures = []
    for name, found in (("before", before), ("after", after)):
        wrong = "" if args.truth is None else f", wrong or unmeasured {100 * found.wrong:.2f} %"
        said = f"measured {100 * found.fill:.2f} %, noise {found.noise_px:.3f} px{wrong}"
        figures.append(Figure(name, said, {"fill": found.fill, "noise": found.noise_px, "truth": found.wrong}[goal]))
    words = list(args.given)
    at = next(place for place, word in enumerate(words) if len(word) > 3 and "--search".startswith(word))
    del words[at : at + 3]
    steps = [command(*words, "--settings", out, "-o", out.with_suffix(""))]
    sentence = f"{out}: the best settings for {goal} that {len(pairs)} pairs tell."
    print(screen(sentence, figures, [f"assumed: {line}" for line in assumed], steps, verbose=args.verbose))


def _chosen_pairs(recording: Path, chosen: list[int]) -> list[Pair]:
    from activestereo.capture.importers.bag import is_bag
    from activestereo.capture.importers.pairs import recorded_pairs
    from activestereo.capture.importers.trajectory import refuse_foreign

    if not recording.is_dir() and not is_bag(recording):
        refuse_foreign(recording)
        raise CommandError(f"{recording}: is neither a folder nor a bag; of a pair of images give both")
    places = iter(range(chosen[-1] + 1))
    pairs = list(islice(recorded_pairs(recording, lambda name: next(places, -1) in chosen), len(chosen)))
    if not pairs:
        raise CommandError(f"{recording}: no infrared pair: its two streams have no images of one time")
    return pairs


def _truths(
    args: argparse.Namespace, chosen: list[int], cameras: RectifiedPair, shape: tuple[int, ...]
) -> list[np.ndarray]:
    """Reads the true depth of the chosen pairs as disparities in pixels, float32 [height][width], NaN where unknown.
    chosen: the pairs' numbers in the recording; shape: (height, width)."""
    from activestereo.capture.images import read_gray

    files = sorted(args.truth.glob("*.png"))
    if len(files) <= chosen[-1]:
        raise CommandError(f"--truth {args.truth}: has {len(files)} PNG files, the recording {chosen[-1] + 1} pairs")
    out = []
    for place in chosen:
        depth_m = 0.001 * read_gray(files[place], (shape[1], shape[0]), "truth").astype(np.float64)
        with np.errstate(divide="ignore"):
            disparity = cameras.focal_baseline_px_m / depth_m - cameras.offset_px
        out.append(np.where(depth_m > 0, disparity, np.nan).astype(np.float32))
    return out
