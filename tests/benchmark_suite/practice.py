#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Diagnoses practice captures.

    python3 tests/benchmark_suite/practice.py CAPTURES --out out/practice

CAPTURES holds practice-NN folders, each with its answer.json, which the tool does not get to see. Prints a Markdown
table: verdict and first names, the share of the gap between base model and floor that is closed, the test error of the
model that was found, its floor, and the time of the diagnosis (wall and processor seconds) with all renders and once
more with renders kept on disk. Diagnoses that were run already are not run again."""

import argparse
import json
import os
import resource
import shutil
import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOL = str(ROOT / "build/bin/activestereo")
HEAD = (
    "| capture | hidden | verdict, found | gap closed | test error, DN | floor, DN | diagnosis | again |",
    "|---|---|---|---|---|---|---|---|",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path, metavar="CAPTURES")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="folders of these names alone")
    parser.add_argument("--tool", default=TOOL, help="the command line (default: %(default)s)")
    parser.add_argument("--device", default="auto", help="as of the command line (default: %(default)s)")
    args = parser.parse_args()
    print("\n".join(HEAD), flush=True)
    for folder in sorted(args.captures.glob("practice-*")):
        if args.only is None or folder.name in args.only:
            print(row(folder, args.out.resolve(), args.tool, args.device), flush=True)


def row(folder: Path, out: Path, tool: str, device: str) -> str:
    """Diagnoses a practice capture twice, first without kept renders, and returns its row of the Markdown table."""
    capture, place, answer = out / "captures" / folder.name, out / folder.name, folder / "answer.json"
    if not capture.is_dir():
        shutil.copytree(folder, capture, ignore=shutil.ignore_patterns(answer.name))
    said, first = kept(place / "diagnose.json", [tool, "diagnose", str(capture), "--device", device], out / "renders")
    _, again = kept(
        place / "again" / "diagnose.json", [tool, "diagnose", str(capture), "--device", device], out / "renders"
    )
    truth = json.loads(answer.read_text())
    hidden = ", ".join(effect["effect"] for effect in truth["effects"]) or "nothing"
    error = truth["oracle"]["ir_rmse_dn"]["test"]
    diagnosed = said["heldout_ir_rmse_after"]
    gap = (error["before"] - diagnosed) / (error["before"] - error["floor"]) if truth["effects"] else None
    cells = [
        folder.name,
        hidden,
        ", ".join([said["verdict"], *said["added"]]),
        "" if gap is None else f"{gap:.2f}",
        f"{diagnosed:.3f}",
        f"{error['floor']:.3f}",
        f"{first['wall_s']:.0f} s, {first['processor_s']:.0f} s",
        f"{again['wall_s']:.0f} s, {again['processor_s']:.0f} s",
    ]
    return f"| {' | '.join(cells)} |"


def kept(result: Path, command: list[str], cache: Path) -> tuple[dict, dict]:
    """Returns (the JSON that a command wrote to `result`, its times), kept from an earlier run where there is one."""
    times = result.with_name("times.json")
    if not times.is_file():
        result.parent.mkdir(parents=True, exist_ok=True)
        before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        environment = os.environ | {"ACTIVESTEREO_CACHE": str(cache)}
        with open(result.with_name("log.txt"), "w") as log:
            subprocess.run([*command, "--out", str(result.parent)], check=True, stdout=log, stderr=log, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
        times.write_text(json.dumps({"wall_s": time.monotonic() - started, "processor_s": used}))
    return json.loads(result.read_text()), json.loads(times.read_text())


if __name__ == "__main__":
    main()
