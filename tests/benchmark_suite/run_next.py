#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Does the measurement that the tool asks for separate what it could not tell apart?

    python3 tests/benchmark_suite/run_next.py --set all --out out/suite-all --most 20

Takes test cases of a benchmark suite that was run, where the first name has others beside it that fit as well and the
truth is among them. Each is made once more with the frames that the tool asks for, and once with frames of a random
choice, and diagnosed again. DIR/next/WORLD/{asked,random}/ holds the answers; run_suite.py scores them with the rest.
Resumable.
"""

import json
import multiprocessing
import os
import shutil
import sys

import numpy as np
from suite_score import read_results
from suite_sets import items
from make_case import make_case
from run_suite import diagnose_capture, parser_of_a_run
from virtual_sensor.held_out.more import CHOICES


def main():
    parser = parser_of_a_run(__doc__)
    parser.add_argument("--most", type=int, default=20, metavar="N", help="test cases (default: 20)")
    args = parser.parse_args()
    by_id = {item.id: item for item in items(args.set, args.generation)}
    chosen = [r for r in read_results(args.out, by_id) if r.is_ambiguous][: args.most]
    print(f"{len(chosen)} test cases where the truth is one of several names")
    tasks = [
        (by_id[r.key["id"]], how, change, args)
        for r in chosen
        for how, change in (("asked", asked_change(r.answer)), ("random", random_change(by_id[r.key["id"]])))
    ]
    with multiprocessing.get_context("spawn").Pool(args.jobs) as pool:
        for line in pool.imap_unordered(_follow, tasks):
            print(line, flush=True)
    return 0


def asked_change(answer):
    """Returns the change of frames that the diagnosis advises first, None without such advice."""
    return answer["next_measurement"][0]["change"] if answer["next_measurement"] else None


def random_change(item):
    rng = np.random.Generator(np.random.PCG64([item.seed, 31]))
    return CHOICES[str(rng.choice(list(CHOICES)))]


def _follow(task):
    item, how, change, args = task
    place = args.out.resolve() / "next" / item.id / how
    if change is None or (place / "diagnose.json").is_file():
        return f"{item.id} {how}: {'no frames to record' if change is None else 'done before'}"
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    place.mkdir(parents=True, exist_ok=True)
    capture = place / "capture"
    make_case(item, capture, place / "key.json", args.scene_errors, more=change)
    run = diagnose_capture(args.command, capture, place, args.timeout)
    shutil.rmtree(capture)
    (place / "change.json").write_text(json.dumps(change))
    return f"{item.id} {how} {change}: {run['said']}"


if __name__ == "__main__":
    sys.exit(main())
