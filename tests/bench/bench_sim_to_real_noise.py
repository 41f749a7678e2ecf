# SPDX-License-Identifier: Apache-2.0
"""Compares what `calibrate noise` finds of the camera of bench_sim_to_real.py's foreign world of Mitsuba 3: the
model of its noise and its parameters, from repeats of views in which nothing moves. None of them is a
test view.

    pip install mitsuba     # 3.9 was tried
    PYTHONPATH=build/python python3 tests/bench/bench_sim_to_real_noise.py --out out/noise
    python3 tests/bench/bench_sim_to_real.py run out/gap --foreign mitsuba --imager out/noise/model.json
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from activestereo.calibrate.frames import Repeats
from activestereo.calibrate.noise import calibrate_noise
from sim_to_real.foreign_mitsuba import MitsubaStage
from sim_to_real.objects import objects
from sim_to_real.stage import CameraSettings
from sim_to_real.views import round_of_views
from activestereo.model.write import write_model


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=30)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    stage, random = MitsubaStage(objects(), CameraSettings()), np.random.default_rng(1)
    views = []
    for view in round_of_views(objects(), 0, "tuning", 0)[: args.views]:
        for side, counts in zip(("left", "right"), stage.repeats(view, args.repeats, random), strict=True):
            name = f"{objects()[view.object_index].name}, {side}"
            views.append(Repeats(name, counts, None, name))
    found = calibrate_noise(views)
    args.out.mkdir(parents=True, exist_ok=True)
    write_model(args.out / "model.json", found.model())
    print(found.summary())


if __name__ == "__main__":
    main()
