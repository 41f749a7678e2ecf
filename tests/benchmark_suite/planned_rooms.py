#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Effects in recordings of drawn rooms, named with the recordings that a plan asks for.

    python3 tests/benchmark_suite/planned_rooms.py OUT --seed 7 [--cases 48] [--jobs 32]

Every case draws a room (tests/python/shared/room_worlds.py) and plans recordings of it while the camera is good. Then
it draws a kind of measured_rooms.py and a size from medium to one and a half times strong, until the plan promises that
a recording of the room tells it. Three views are recorded with the effect in them, and the recording that the plan
asks for: a further view, or the good session. OUT/results.json has a row for each case, written when it is done.
`--jobs` processes of one thread work at once; a run that was cut short goes on from OUT's rows.
"""

import argparse
import json
import shutil
import sys
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "python" / "shared"))

from inject.inject import plan, write_injected
from inject.kinds import KINDS
from measured_rooms import ACCEPTED, EXPOSURES, TURNS, in_parallel, is_told, recorded
from activestereo.calibrate.world import cells
from activestereo.calibrate.world.world import calibrate_world
from activestereo.capture.capture import read_capture
from activestereo.diagnose import diagnose
from activestereo.diagnose.room.names import score_room
from activestereo.diagnose.room.plan import plan_of
from activestereo.effects import builtin

# Every lens has vignetting: more of it changes a size and yields no name.
DRAWN = sorted(set(KINDS) - {"vignetting"})
# The recordings that the plan's texts ask for: a further view (turn, exposure), or the good unit in the same places.
# AGAIN: degrees by which a tripod misses its former place.
VIEWS = {"turned by 15 degrees": ((15, 0), 1.0), "rolled by 90 degrees": ((0, 0, 90), 1.0), "half or": ((0, 0), 0.5)}
GOOD, AGAIN = "known to be good", 0.3


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, default=48)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    results = args.out / "results.json"
    rows = json.loads(results.read_text()) if results.exists() else []
    left = sorted(set(range(args.cases)) - {row["case"] for row in rows})
    for row in in_parallel(partial(case, args.out, args.seed), left, args.jobs):
        rows = sorted([*rows, row], key=lambda row: row["case"])
        results.write_text(json.dumps(rows, indent=1) + "\n")
        verdicts = [row["verdict"] for row in rows]
        score = ", ".join(f"{verdicts.count(v)} {v}" for v in ("right", "wrong", "silent", "refused"))
        print(json.dumps(row), f"{score} of {len(rows)}", sep="\n", flush=True)


def case(out, seed, number):
    """Runs one case and returns its row: what was hidden, what the plan promised, the names and the verdict."""
    folder = out / f"{seed}_{number}"
    row = {"case": number, **promised(folder, np.random.default_rng([seed, number]))}
    try:
        return answered(folder, row)
    except ValueError as error:
        return row | {"verdict": "refused", "why": str(error)}


def promised(folder, rng):
    """Draws a room and an effect that the plan of its good session tells, and returns the case's row. row["by"]: the
    recording that tells it; row["least"]: the sizes from which on."""
    shutil.rmtree(folder, ignore_errors=True)  # of a run that was cut short
    folder.mkdir()
    row = {"seed": int(rng.integers(2**31))}
    recorded(folder / "clean", row["seed"], TURNS, EXPOSURES)
    calibrate_world(folder / "clean", folder / "planned")
    capture = read_capture(folder / "planned")
    recordings = plan_of(score_room(cells.Room(capture), builtin()))
    while True:
        kind = DRAWN[rng.integers(len(DRAWN))]
        _, medium, strong = KINDS[kind].values
        size = round(float(np.exp(rng.uniform(np.log(medium), np.log(1.5 * strong)))), 5)
        truth = plan(read_capture(folder / "clean"), kind, str(size), row["seed"]).parameters
        for recording in recordings:
            tells = {effect: told for effect, told in recording.tells.items() if told is not None}
            told, least = is_told(tells, kind, truth, capture)
            if told:
                return row | {"hidden": kind, "size": size, "truth": truth, "by": recording.text, "least": least}


def answered(folder, row):
    """Records what the plan asks for with the effect in it, and returns the row with named effects and verdict."""
    view = next((view for text, view in VIEWS.items() if text in row["by"]), None)
    clean, reference = folder / "clean", []
    if view is not None:
        clean = recorded(folder / "more", row["seed"], (*TURNS, view[0]), (*EXPOSURES, view[1]))
    elif GOOD in row["by"]:
        reference, rng = [folder / "good"], np.random.default_rng(row["seed"])
        turns = [tuple(np.array(turn) + rng.normal(0.0, AGAIN, 2)) for turn in TURNS]
        calibrate_world(recorded(folder / "again", row["seed"], turns, EXPOSURES, session=1), reference[0])
    write_injected(plan(read_capture(clean), row["hidden"], str(row["size"]), row["seed"]), folder / "flawed")
    calibrate_world(folder / "flawed", folder / "measured")
    result = diagnose(folder / "measured", reference=reference).result
    named = [effect for effect in result["added"] if effect != "vignetting"]
    verdict = "silent" if not named else "right" if named[0] in ACCEPTED[row["hidden"]] else "wrong"
    return row | {"named": named, "verdict": verdict}


if __name__ == "__main__":
    main()
