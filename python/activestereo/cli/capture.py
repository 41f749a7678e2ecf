# SPDX-License-Identifier: Apache-2.0
"""Implements `activestereo capture check`: prints every fault of a capture at once."""

import argparse
import sys
from pathlib import Path

from activestereo.cli.arguments import Commands, Finding, add_shared, print_json
from activestereo.common.shown import printable

_TEXT = """\
Checks a capture: each key of capture.json and each image. All that is wrong is printed at
once, a line each; the exit status is 0 where all is well, else 1.

example:
  activestereo capture check captures/desk
"""


def add_parser(commands: Commands) -> None:
    parser = commands.add_parser("capture", help="check a capture", description=_TEXT)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    check = actions.add_parser("check", help="all that is wrong, at once", description=_TEXT)
    check.add_argument("folder", type=Path, metavar="FOLDER", help="the capture's folder")
    add_shared(check, json=True)
    check.set_defaults(run=run_check)


def run_check(args: argparse.Namespace) -> None:
    from activestereo.capture.check import capture_faults

    faults = capture_faults(args.folder)
    lines = [printable(fault) for fault in faults] or [f"{printable(args.folder)}: all is well"]
    print_json(faults) if args.json else print("\n".join(lines))
    sys.stdout.flush()
    if faults:
        raise Finding(f"{args.folder}: {len(faults)} fault{'s' if len(faults) > 1 else ''}")
