# SPDX-License-Identifier: Apache-2.0
"""activestereo benchmark matchers: matchers beside each other on simulated pairs. activestereo benchmark network: a
small network that becomes one of them."""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.cli.arguments import (
    CommandError,
    Commands,
    add_shared,
    check_out_file,
    integer_from,
    make_folder,
    print_json,
)
from activestereo.cli.depth import PROFILES
from activestereo.common.input_files import read_json

_TEXT = """\
Matches pairs of eight things, from clay to glass, on a table: simsense's profiles and
the camera's own matcher, OpenCV's SGBM and BM, and networks in ONNX files. What each
loses, unmeasured or off by more than a pixel, is told by material, with the projector
on, off and in turn -> DIR/matchers.json, matchers.md, matchers.png

examples:
  activestereo benchmark matchers --out out/matchers
  activestereo benchmark network out/small.onnx
  activestereo benchmark matchers --network out/small.onnx --out out/matchers
"""

_NETWORK = """\
Trains a small stereo network on pairs of the same things in other materials, poses and
light, and writes it as an ONNX file, which StereoDepthSensor(matcher=...) takes, too.
Needs PyTorch and onnx (pip install torch onnx). A GPU takes minutes.
"""

_VIEWS = 8  # of a round: they are rendered at once
_TRAINING_SEED = 1_000_000  # views of training begin here, so that none is a test's


def add_matchers(kinds: Commands) -> None:
    raw = argparse.RawDescriptionHelpFormatter
    text = "measure how matchers err by material, with the projector on, off and in turn"
    parser = kinds.add_parser("matchers", help=text, description=_TEXT, formatter_class=raw)
    add_shared(parser, out=True)
    text = "a network to measure, too; may be given again"
    parser.add_argument("--network", type=Path, action="append", default=[], metavar="FILE.onnx", help=text)
    _add_pictures(parser, 64)
    add_shared(parser, json=True)
    parser.set_defaults(run=_run)
    parser = kinds.add_parser("network", help="train a small stereo network", description=_NETWORK, formatter_class=raw)
    parser.add_argument("file", type=Path, metavar="FILE.onnx", help="the network")
    text = "steps of training, 4 crops each (default: 4000)"
    parser.add_argument("--steps", type=integer_from(1), default=4000, metavar="N", help=text)
    _add_pictures(parser, 512)
    parser.set_defaults(run=_run_network)


def _add_pictures(parser: argparse.ArgumentParser, views: int) -> None:
    add_shared(parser, device=True, seed="of everything that is drawn; same seed, same scores")
    text = f"views, in whole rounds of {_VIEWS} (default: {views})"
    parser.add_argument("--views", type=integer_from(1), default=views, metavar="N", help=text)
    parser.add_argument("--sensor", default="d435", metavar="NAME", help="as simulate's (default: d435)")
    text = "rays per pixel (default: 16)"
    parser.add_argument("--samples-per-pixel", type=integer_from(1), default=16, metavar="N", help=text)


def _run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.matchers.pairs import PairStudio
    from activestereo.benchmarks.matchers.report import table, write_report
    from activestereo.benchmarks.matchers.score import matchers, scores
    from activestereo.common.progress_bar import ProgressBar

    make_folder(args.out)
    rounds = -(-args.views // _VIEWS)
    studio = PairStudio(min(_VIEWS, args.views), False, args.sensor, args.samples_per_pixel, args.device)
    known = matchers(studio.config, PROFILES, args.network)
    with ProgressBar(f"{args.views} views, {len(known)} matchers") as bar:
        found = scores(studio, known, rounds, args.seed, bar)
    about = {"sensor": args.sensor, "views": args.views, "seed": args.seed, "samples": args.samples_per_pixel}
    write_report(found, args.out, about)
    if args.json:
        print_json(read_json(args.out / "matchers.json"))
        return
    print("\n".join(table(found)))
    print(f"written: {args.out / 'matchers.json'}, matchers.md, matchers.png")


def _run_network(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.matchers.pairs import Pairs, PairStudio, joined
    from activestereo.common.progress_bar import ProgressBar

    check_out_file(args.file)
    try:
        import onnx  # noqa: F401

        from activestereo.benchmarks.matchers.network import train, write_onnx
    except ImportError as error:
        raise CommandError(f"{error.name} is missing: pip install torch onnx") from error
    rounds = -(-args.views // _VIEWS)
    studio = PairStudio(min(_VIEWS, args.views), True, args.sensor, args.samples_per_pixel, args.device)
    taken: list[Pairs] = []
    with ProgressBar(f"{args.views} views to train on") as bar:
        for number in range(rounds):
            taken += studio.take(_TRAINING_SEED + args.seed * rounds + number).values()
            bar((number + 1) / rounds)
    with ProgressBar(f"{args.steps} steps of training") as bar:
        network = train(joined(taken), studio.config.max_disparity, args.steps, args.seed, bar)
    write_onnx(network, args.file)
    print(f"{sum(one.numel() for one in network.parameters())} weights; written: {args.file}")
