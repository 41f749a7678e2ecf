# SPDX-License-Identifier: Apache-2.0
"""Matchers beside each other on simulated pairs of eight things, from clay to glass, on a table.

They are simsense's profiles and the camera's own matcher, OpenCV's SGBM and BM, and networks in ONNX files. What each
loses, unmeasured or off by more than a pixel, is told by material, with the projector on, off and in turn
-> OUT/matchers.json, matchers.md, matchers.png.

    PYTHONPATH=build/python python3 tests/bench/bench_matchers.py compare out/matchers [--network out/small.onnx]
    PYTHONPATH=build/python python3 tests/bench/bench_matchers.py train out/small.onnx

train: a small stereo network on pairs of the same things in other materials, poses and light, as an ONNX file, which
StereoDepthSensor(matcher=...) takes, too. It needs PyTorch and onnx (pip install torch onnx). A GPU takes minutes.
"""

import argparse
from pathlib import Path

from activestereo.cli.depth import PROFILES
from activestereo.common.progress_bar import ProgressBar
from matchers.pairs import Pairs, PairStudio, joined
from matchers.report import table, write_report
from matchers.score import matchers, scores

VIEWS = 8  # of a round: they are rendered at once
TRAINING_SEED = 1_000_000  # views of training begin here, so that none is a test's


def compare(args: argparse.Namespace) -> None:
    args.out.mkdir(parents=True, exist_ok=True)
    studio = PairStudio(min(VIEWS, args.views), False, args.sensor, args.samples_per_pixel, args.device)
    known = matchers(studio.config, PROFILES, args.network)
    with ProgressBar(f"{args.views} views, {len(known)} matchers") as bar:
        found = scores(studio, known, -(-args.views // VIEWS), args.seed, bar)
    about = {"sensor": args.sensor, "views": args.views, "seed": args.seed, "samples": args.samples_per_pixel}
    write_report(found, args.out, about)
    print("\n".join(table(found)))


def train(args: argparse.Namespace) -> None:
    from matchers.network import train as trained
    from matchers.network import write_onnx

    rounds = -(-args.views // VIEWS)
    studio = PairStudio(min(VIEWS, args.views), True, args.sensor, args.samples_per_pixel, args.device)
    taken: list[Pairs] = []
    with ProgressBar(f"{args.views} views to train on") as bar:
        for number in range(rounds):
            taken += studio.take(TRAINING_SEED + args.seed * rounds + number).values()
            bar((number + 1) / rounds)
    with ProgressBar(f"{args.steps} steps of training") as bar:
        network = trained(joined(taken), studio.config.max_disparity, args.steps, args.seed, bar)
    write_onnx(network, args.out)
    print(f"{sum(one.numel() for one in network.parameters())} weights; written: {args.out}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(required=True)
    for run, views in ((compare, 64), (train, 512)):
        kind = kinds.add_parser(run.__name__)
        kind.add_argument("out", type=Path)
        kind.add_argument("--views", type=int, default=views, help=f"in whole rounds of {VIEWS}")
        kind.add_argument("--sensor", default="d435")
        kind.add_argument("--samples-per-pixel", type=int, default=16)
        kind.add_argument("--device", default=None)
        kind.add_argument("--seed", type=int, default=0)
        kind.set_defaults(run=run)
    kinds.choices["compare"].add_argument("--network", type=Path, action="append", default=[])
    kinds.choices["train"].add_argument("--steps", type=int, default=4000, help="4 crops each")
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
