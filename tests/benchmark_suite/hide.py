#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes one capture with a hidden effect, and the answer in another place: hide.py SEED CAPTURE_FOLDER KEY_FILE
[ELSEWHERE_FOLDER]. Says nothing of it. ELSEWHERE_FOLDER: what the same sensor takes of another scene."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from suite_sets import STRONG, Item  # noqa: E402
from make_case import make_case  # noqa: E402
from virtual_sensor.held_out.catalogue import SINGLE  # noqa: E402

# The suite's own test cases have smaller seeds.
_FIRST_SEED = 900_000
_OTHER_SCENE = 50_000


class Secret(Item):
    """A benchmark item outside of the benchmark's sets, with seeds of its own; main() hides one strong effect in it."""

    @property
    def seed(self):
        return _FIRST_SEED + self.number


def main():
    if len(sys.argv) not in (4, 5) or not sys.argv[1].isdecimal():
        print(__doc__, file=sys.stderr)
        return 2
    number, capture, key = int(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3])
    effect = str(np.random.Generator(np.random.PCG64([number, 77])).choice(list(SINGLE)))
    capture.parent.mkdir(parents=True, exist_ok=True)
    item = Secret("secret", number, ((effect, STRONG),))
    elsewhere = (Path(sys.argv[4]), item.seed + _OTHER_SCENE) if len(sys.argv) == 5 else None
    make_case(item, capture, key, scene_errors=1.0, elsewhere=elsewhere)
    return 0


if __name__ == "__main__":
    sys.exit(main())
