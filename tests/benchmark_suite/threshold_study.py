#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How much the benchmark suite's figures move when a threshold of the diagnosis is halved and doubled.

    python3 tests/benchmark_suite/threshold_study.py --set small --out out/suite

Reads the answers of a benchmark suite that was run: each holds the numbers that its verdict rests on. Verdicts are
passed again, nothing is fitted again: what a threshold changes earlier (which effects are fitted, what --greedy goes on
to add) does not show. Prints a Markdown table. """

import argparse
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "build" / "python"))

from suite_score import Result, read_results  # noqa: E402
from suite_sets import ALL, items  # noqa: E402

from activestereo.diagnose.thresholds import THRESHOLDS, Thresholds  # noqa: E402
from activestereo.diagnose.answer.judging import verdict_under  # noqa: E402

Figures = tuple[float | None, float | None, float | None]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", choices=("small", *ALL, "all"), required=True)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="of run_suite.py")
    parser.add_argument("--generation", type=int, default=0, metavar="N")
    args = parser.parse_args()
    results = [
        r
        for r in read_results(args.out, [i.id for i in items(args.set, args.generation)])
        if "judging" in (r.answer or {})
    ]
    if not results:
        print("no answer holds what its verdict rests on: run run_suite.py first", file=sys.stderr)
        return 1
    print(study(results))
    return 0


def study(results: Sequence[Result], thresholds: Thresholds = THRESHOLDS) -> str:
    """The table: each threshold that moves a figure, halved and doubled."""
    now = figures(results, thresholds)
    lines = [
        f"{len(results)} test cases. Named and right {_text(now[0])}, false alarms {_text(now[1])}, outside said so "
        f"{_text(now[2])}.",
        "",
        "| threshold | value | halved | doubled |",
        "|---|---|---|---|",
    ]
    silent = []
    for field in fields(thresholds):
        value = getattr(thresholds, field.name)
        moved = [figures(results, replace(thresholds, **{field.name: factor * value})) for factor in (0.5, 2.0)]
        if all(figure == now for figure in moved):
            silent.append(f"`{field.name}`")
        else:
            lines.append(f"| `{field.name}` | {value:g} | {' | '.join(_change(now, figure) for figure in moved)} |")
    return "\n".join([*lines, "", f"No figure moves by: {', '.join(silent)}."])


def figures(results: Sequence[Result], thresholds: Thresholds) -> Figures:
    """(detectable single effects named and right, false alarms, outside said so) of first steps."""
    said = [(r, *verdict_under(r.answer["judging"], thresholds)) for r in results]
    single = [
        verdict == "effect" and {r.case_name(name)} == r.truth
        for r, verdict, name in said
        if r.key["set"] == "single" and r.detectable
    ]
    none = [verdict == "effect" for r, verdict, _ in said if r.key["set"] == "none"]
    outside = [verdict == "unknown" for r, verdict, _ in said if r.key["set"] == "outside"]
    return tuple(sum(part) / len(part) if part else None for part in (single, none, outside))


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _change(now: Figures, then: Figures) -> str:
    names = ("named and right", "false alarms", "outside")
    parts = [f"{name} {b - a:+.3f}" for name, a, b in zip(names, now, then, strict=True) if a is not None and a != b]
    return ", ".join(parts) or "-"


if __name__ == "__main__":
    sys.exit(main())
