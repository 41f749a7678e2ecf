#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Decides test cases of the benchmark suite again from the findings that their answers keep; nothing is rendered.

    python3 tests/benchmark_suite/decide_again.py --out out/suite [--set all] [--generation N]

Prints the suite's measures: of the answers as they are, and of the law of decision (diagnose/decision/law.py). """

import argparse
import sys
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "build" / "python"))

from suite_score import Result, read_results, score  # noqa: E402
from suite_sets import ALL, items  # noqa: E402

from activestereo.diagnose.decision.law import Decision, Law, decide  # noqa: E402
from activestereo.diagnose.decision.records import Findings  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", choices=("small", *ALL, "all"), default="all")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="of run_suite.py")
    parser.add_argument("--generation", type=int, default=0, metavar="N")
    parser.add_argument("--alpha", type=float, nargs="+", default=[0.01, 0.05])
    args = parser.parse_args()
    results = read_results(args.out, [i.id for i in items(args.set, args.generation)])
    results = [r for r in results if "findings" in (r.answer or {})]
    if not results:
        print("no answer keeps findings: run run_suite.py first", file=sys.stderr)
        return 1
    try:
        read = [Findings.of_json(r.answer["findings"]) for r in results]
    except (TypeError, KeyError) as error:
        print(f"the answers are of another version of the lab ({error}): run run_suite.py again", file=sys.stderr)
        return 1
    columns = {"rules": score(results)["measures"]}
    for alpha in args.alpha:
        law = [decide(Law(alpha=alpha), findings) for findings in read]
        columns[f"law, alpha {alpha:g}"] = score([*map(decided, results, law)])["measures"]
    print(f"| {len(results)} test cases | {' | '.join(columns)} |\n|---|{'---|' * len(columns)}")
    for name in next(iter(columns.values())):
        print(f"| {name} | {' | '.join(_text(measures[name]) for measures in columns.values())} |")
    return 0


def decided(result: Result, decision: Decision) -> Result:
    """A Result as if the law had given its answer."""
    answer = result.answer
    rows = {entry["effect"]: entry for entry in answer["ranking"]}
    order = sorted(rows, key=lambda name: -decision.likeness(name))
    first = [name for name in decision.named if name in rows]
    ranking = [_row(rows[name], decision) for name in dict.fromkeys([*first, *order])]
    said = {"verdict": decision.verdict, "added": list(decision.named), "ranking": ranking}
    return replace(result, answer=answer | said)


def _row(entry: dict, decision: Decision) -> dict:
    name = entry["effect"]
    equivalent = list(decision.equivalent.get(name, ()))
    return entry | {"confidence": decision.confidence(name), "equivalent": equivalent}


def _text(measure: dict) -> str:
    return "-" if measure["value"] is None else f"{measure['value']:.3f} ({measure['n']})"


if __name__ == "__main__":
    sys.exit(main())
