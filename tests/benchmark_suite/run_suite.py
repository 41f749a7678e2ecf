#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the benchmark suite: makes test cases with hidden effects, has the tool diagnose each, and scores its answers.

    python3 tests/benchmark_suite/run_suite.py --set small --out out/suite

Resumable: test cases that have an answer in DIR are not run again. DIR holds keys/ (the truth, which the tool does not
see), captures/ (as long as needed), answers/ (diagnose.json and the tool's output), then score.json, README.md and its
pictures."""

import argparse
import json
import multiprocessing
import os
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMAND = f"{ROOT / 'build/bin/activestereo'} diagnose {{capture}} --out {{out}} --workers 1"


def main():
    args = _arguments()
    from suite_sets import items

    todo = [item for item in items(args.set, args.generation) if is_wanted(item, args.only)][: args.limit]
    if args.only and not todo:
        told = f"no test case of the set '{args.set}' has such an id or hides such an effect"
        sys.exit(f"--only {' '.join(args.only)}: {told}")
    waiting = [item for item in todo if not (args.out / "answers" / item.id / "run.json").is_file()]
    print(f"{args.set}: {len(todo)} test cases, {len(todo) - len(waiting)} answered already")
    _run_all(waiting, args)
    from suite_page import write_page
    from suite_score import read_results, score

    results = read_results(args.out, [item.id for item in todo])
    scores = score(results)
    (args.out / "score.json").write_text(json.dumps(scores, indent=1) + "\n")
    print(write_page(scores, results, args.out, args.set))
    right = sum(result.right for result in results)
    print(f"{right} of {len(results)} test cases answered in full and without error; {args.out / 'README.md'}")
    return 1 if right < args.least or any(result.failed for result in results) else 0


def parser_of_a_run(description):
    """Returns a parser with the options of all that diagnoses test cases."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    sets = ("small", "single", "pairs", "outside", "none", "depth", "wider", "filters", "mitsuba", "all")
    parser.add_argument("--set", choices=sets, required=True)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--command", default=COMMAND, help="the tool, with {capture} and {out} (default: %(default)s)")
    for name, default, metavar, words in (
        ("--jobs", 2, "N", "cases at a time, each on its share of the cores (default: 2)"),
        ("--generation", 0, "N", "other test cases of the same kinds (default: 0, the suite's own)"),
        ("--scene-errors", 1.0, "X", "size of the calibration's and scene's errors, which captures then state "
                                     "(default: 1)"),
        ("--timeout", 900.0, "S", "seconds per diagnosis (default: 900)"),
    ):  # fmt: skip
        parser.add_argument(name, type=type(default), default=default, metavar=metavar, help=words)
    return parser


def _arguments():
    parser = parser_of_a_run(__doc__)
    parser.add_argument("--only", nargs="+", metavar="NAME",
                        help="test cases of these ids, or that hide one of these effects")  # fmt: skip
    parser.add_argument("--limit", type=int, metavar="N", help="the first N test cases only")
    parser.add_argument("--keep", action="store_true", help="keep the captures")
    parser.add_argument("--least", type=int, default=0, metavar="N",
                        help="fail where fewer test cases are answered rightly")  # fmt: skip
    return parser.parse_args()


def is_wanted(item, names):
    """Returns whether a case is selected. names: ids of cases or hidden effects; None selects every case."""
    return names is None or item.id in names or any(effect in names for effect, _ in item.strengths)


def _run_all(waiting, args):
    started = time.monotonic()
    cores = sorted(os.sched_getaffinity(0))
    context = multiprocessing.get_context("spawn")
    lock_ids = context.Queue()
    for job in range(args.jobs):
        lock_ids.put(cores[job :: args.jobs] or cores)
    with context.Pool(args.jobs, initializer=_take_cores, initargs=(lock_ids,)) as pool:
        options = args.out.resolve(), args.scene_errors, args.command, args.timeout, args.keep
        tasks = [(item, *options) for item in waiting]
        for done, (item_id, run) in enumerate(pool.imap_unordered(_run_one, tasks), 1):
            left = (time.monotonic() - started) / done * (len(waiting) - done)
            what = run["said"] if run["returncode"] == 0 else f"failed ({run['returncode']})"
            told = f"{item_id}: {run['diagnose_s']:.0f} s, {what}; {_duration(left)} left"
            print(f"[{done}/{len(waiting)}] {told}", flush=True)


def _take_cores(shares):
    """Binds this worker, and the tool that it starts, to its own processor cores. shares: queue of sets of cores."""
    os.sched_setaffinity(0, shares.get())
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = str(len(os.sched_getaffinity(0)))


def _run_one(task):
    item, out, scene_errors, command, timeout, keep = task
    sys.path.insert(0, str(Path(__file__).resolve().parent))
    from make_case import make_case

    capture, key = out / "captures" / item.anonymous_name, out / "keys" / f"{item.id}.json"
    answer = out / "answers" / item.id
    shutil.rmtree(answer, ignore_errors=True)
    answer.mkdir(parents=True)
    started = time.monotonic()
    if not (key.is_file() and capture.is_dir()):
        capture.parent.mkdir(parents=True, exist_ok=True)
        make_case(item, capture, key, scene_errors)
    made = time.monotonic()
    run = diagnose_capture(command, capture, answer, timeout)
    run |= {"make_s": made - started, "diagnose_s": time.monotonic() - made}
    (answer / "run.json").write_text(json.dumps(run))
    if not keep:
        shutil.rmtree(capture)
    return item.id, run


def diagnose_capture(command, capture, answer, timeout):
    """Runs the tool on a capture folder for at most `timeout` seconds. Returns {returncode, said}."""
    words = [word.format(capture=capture, out=answer) for word in shlex.split(command)]
    with open(answer / "log.txt", "w") as log:
        try:
            code = subprocess.run(words, stdout=log, stderr=subprocess.STDOUT, timeout=timeout, cwd=answer).returncode
        except subprocess.TimeoutExpired:
            code = "timeout"
    said = "no answer"
    if (answer / "diagnose.json").is_file():
        result = json.loads((answer / "diagnose.json").read_text())
        engine = result.get("depth", {"verdict": "not judged", "added": []})
        said = " ".join([result["verdict"], *result["added"], "| depth engine:", engine["verdict"], *engine["added"]])
    elif code == 0:
        code = "no diagnose.json"
    return {"returncode": code, "said": said}


def _duration(seconds):
    for least, unit_s, form in ((5400, 3600, ".1f} h"), (90, 60, ".0f} min")):
        if seconds > least:
            return f"{{:{form}".format(seconds / unit_s)
    return f"{seconds:.0f} s"


if __name__ == "__main__":
    sys.exit(main())
