# SPDX-License-Identifier: Apache-2.0
"""activestereo benchmark: compare simulation with reality. realism: in a file of its own."""

from __future__ import annotations

import argparse
from pathlib import Path

from activestereo.cli.arguments import Commands, add_shared, print_json
from activestereo.cli.benchmark_realism import add_realism

_TEXT = """\
Tells how well simulated depth ranks methods as a real camera's depth does, from their
scores in each world: Pearson's and Spearman's correlation over the methods and the mean
gap between scores, with 95 % intervals over the views. SCORES.csv has a header and one
line for each view, or for each score from 0 to 1:

  criterion,method,world,view,found       within 10 mm,ICP on clean,raster,7,1
  criterion,method,world,score            within 10 mm,a network,real,0.83

Depth of 'generate' with a camera's preset, and the same with another camera, are worlds.

example:
  activestereo benchmark sim-to-real scores.csv networks.csv --real lab
"""


def add_parser(commands: Commands) -> None:
    text = "measure how well simulated depth stands for real depth"
    benchmarks = commands.add_parser("benchmark", help=text)
    kinds = benchmarks.add_subparsers(dest="benchmark", metavar="BENCHMARK", required=True)
    add_realism(kinds)
    text = "measure how well simulated depth ranks methods as real depth does"
    parser = kinds.add_parser("sim-to-real", help=text, description=_TEXT)
    parser.add_argument("scores", type=Path, nargs="+", metavar="SCORES.csv", help="a table of scores")
    parser.add_argument("--real", default="real", metavar="WORLD", help="the world of reality (default: real)")
    add_shared(parser, seed="of the resampled views", json=True)
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.sim_to_real import agreement_table, agreements, read_scores

    found = agreements(read_scores(args.scores), args.real, args.seed)
    if args.json:
        print_json({key: {world: own.as_json() for world, own in worlds.items()} for key, worlds in found.items()})
    else:
        print("\n".join(agreement_table(found)))
