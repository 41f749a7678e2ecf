#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Copies a capture and puts one known effect into its measured infrared images, so that the lab can be asked for a
cause that is known amid a real camera's noise and surfaces (inject/README.md).

    python3 tests/benchmark_suite/hide_in_images.py captures/sofa vignetting --strength strong -o out/hidden

DIR/answer.json says what was put in, which names of the lab's library are right, and by how much the images changed.
"""

import argparse
from pathlib import Path

from inject.inject import ANSWER, plan, write_injected
from inject.kinds import KINDS

from activestereo.capture.capture import read_capture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path, help="a capture's folder")
    parser.add_argument("effect", choices=KINDS)
    parser.add_argument("--strength", default="medium", help="weak, medium, strong, or a value of the parameter")
    parser.add_argument("--seed", type=int, default=0, help="of what is drawn: the camera, phases, directions, noise")
    parser.add_argument("--black-level", type=float, metavar="DN", help="default: the images' darkest thousandth")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR", help="a new folder")
    args = parser.parse_args()
    try:
        injection = plan(read_capture(args.capture), args.effect, args.strength, args.seed, args.black_level)
        answer = write_injected(injection, args.out)
    except (OSError, ValueError) as error:
        raise SystemExit(f"hide_in_images: {error}") from None
    print(f"{answer['effect']} {answer['parameters']} in the {' and '.join(answer['cameras'])} images of {args.out}; "
          f"they change by {answer['changed_rms_dn']} DN; the answer is in {ANSWER}")  # fmt: skip


if __name__ == "__main__":
    main()
