# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo demo`: simulates a sensor, hides an effect in a capture, finds it again and opens the
report."""

from __future__ import annotations

import argparse
import os
import webbrowser
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.cli import arguments as cli
from activestereo.common.input_files import read_json_object
from activestereo.common.progress_bar import ProgressBar

_TEXT = """\
Shows in about a minute on two free cores what the project does, each step with the
command that does it alone:

  1  simulates a D435 in front of the example's table, with a quarter of the usual samples:
     DIR/simulated/overview.png
  2  renders a capture of that table, five frames of a quarter of a D435's resolution, and
     hides an effect in its images, by formulas that the lab does not share; neither the lab
     nor you know which
  3  asks the lab what its model lacks, writes DIR/report/report.html and opens it where there
     is a desktop; only then it tells what was hidden
"""


def add_parser(commands: cli.Commands) -> None:
    parser = cli.add_command(commands, "demo", "simulate, hide an effect, find it, and open the report", _TEXT, run)
    text = "new folder for the results (default: out/demo)"
    parser.add_argument("-o", "--out", type=Path, default=Path("out/demo"), metavar="DIR", help=text)
    cli.add_shared(parser, seed="another one hides another effect")
    parser.add_argument("--no-browser", action="store_true", help="tell the report's place only")
    cli.add_shared(parser, device=True)


def run(args: argparse.Namespace) -> None:
    from activestereo.benchmarks.example_capture import HIDDEN, write_example_capture
    from activestereo.scene_io.example_scene import write_table_top

    capture = args.out / "capture"
    if capture.exists():
        raise cli.CommandError(f"{capture} exists already: give another --out")
    cli.make_folder(args.out)
    scene, report = args.out / "table_top.gltf", args.out / "report"
    write_table_top(scene)
    device = ["--device", str(args.device)]
    simulated = str(args.out / "simulated")
    _run_step(args, 1, ["simulate", str(scene), "--sensor", "d435", "--spp", "4", "--out", simulated, *device])
    print("\n== 2 of 3: a small capture is rendered with an effect hidden in it", flush=True)
    secret = str(np.random.Generator(np.random.PCG64([args.seed, 73])).choice(list(HIDDEN)))
    with ProgressBar("rendering the capture") as bar:
        write_example_capture(capture, args.device, args.seed, bar, hidden=secret)
    _run_step(args, 3, ["diagnose", str(capture), "--no-refine", "--out", str(report), *device])
    print(f"\n{_outcome(secret, read_json_object(report / 'diagnose.json'))}")
    page = (report / "report.html").resolve()
    print(f"open {page}")
    if not args.no_browser and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open_new_tab(page.as_uri())


def _run_step(args: argparse.Namespace, number: int, words: list[str]) -> None:
    """Prints and runs another command as if the user had typed it. number: the step's number; words: the command
    without "activestereo"."""
    print(f"\n== {number} of 3: activestereo {' '.join(words)}", flush=True)
    step = args.parser.parse_args(words)
    step.given = words
    step.run(step)


def _outcome(secret: str, diagnosis: Mapping[str, Any]) -> str:
    """Returns two lines: the effect `secret`, which was hidden, and the effects that were found, with values and
    units."""
    from activestereo.benchmarks.example_capture import HIDDEN
    from activestereo.report.diagnosis import parameter_text

    parameter, value = HIDDEN[secret]
    found = {entry["effect"]: entry["parameters"] for entry in diagnosis["ranking"]}
    names = [f"{one}, {parameter_text(*next(iter(found[one].items())))}" for one in diagnosis["added"] if one in found]
    is_found = "yes" if secret in diagnosis["added"] else "no"
    return (
        f"hidden: {secret}, {parameter} {value:.3g}\n"
        f"found: {is_found}, {'; '.join(names) or 'the verdict is ' + diagnosis['verdict']}"
    )
