#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Known effects in recordings of rooms, in a user's order: they are in the camera while it measures the room.

    python3 tests/benchmark_suite/measured_rooms.py OUT RECORDING... [--kind gain] [--strength strong] [--reference DIR]

Each RECORDING is a capture that 'activestereo import' made, of two views or more. All are measured as they are. Then
the kinds of 'activestereo benchmark inject', and drops on a window, go into their images, on one recording after the
other, before calibrate world and diagnose. OUT/results.json has a row for each: the names beside the lens's falloff,
nats, seconds.
"""

import argparse
import json
import shutil
import time
from pathlib import Path

import cv2
import numpy as np

from inject.inject import plan, write_injected
from inject.kinds import KINDS
from activestereo.calibrate.world.world import calibrate_world
from activestereo.capture.capture import SIDES, read_capture
from activestereo.diagnose import diagnose

OWN = "vignetting"  # of every lens: no further name, but an exponent that grows
EXPONENT_SD = 0.25  # of one pair of views
# Drops on one camera's window: discs that are blurred by so many pixels, the same in every view.
DROPS, DISCS, RADII_PX = {"medium": 1.5, "strong": 3.0}, 6, (25, 60)
ACCEPTED = {name: kind.accepted for name, kind in KINDS.items()} | {"drops": ("focus_mismatch",)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--kind", action="append", choices=sorted(ACCEPTED), help="default: all")
    parser.add_argument("--strength", action="append", help="default: medium and strong")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--reference", type=Path, action="append", default=[], help="a measured room of the same unit")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, strength, recording in cases(args):
        rows.append(judged(args, name, strength, recording, rows))
        print(json.dumps(rows[-1]), flush=True)
        (args.out / "results.json").write_text(json.dumps(rows, indent=1) + "\n")
    hidden = [row for row in rows if row["hidden"] is not None]
    right, wrong = (sum(row["verdict"] == verdict for row in hidden) for verdict in ("right", "wrong"))
    print(f"{right} of {len(hidden)} right, {wrong} wrong; nothing hidden: {len(rows) - len(hidden)} rooms, "
          f"{sum(row['verdict'] == 'wrong' for row in rows if row['hidden'] is None)} with a name")  # fmt: skip


def cases(args):
    """(kind, strength, recording): each recording as it is, then the kinds, on one recording after the other."""
    for recording in args.recordings:
        yield None, None, recording
    number = 0
    for strength in args.strength or ("strong", "medium"):
        for name in args.kind or ACCEPTED:
            yield name, strength, args.recordings[number % len(args.recordings)]
            number += 1


def hidden(recording, out, name, strength, seed):
    """Writes the recording with an effect in its images; returns its parameters."""
    if name != "drops":
        return write_injected(plan(read_capture(recording), name, strength, seed), out)["parameters"]
    shutil.copytree(recording, out)
    rng, capture = np.random.default_rng(seed), read_capture(out)
    side = SIDES[rng.integers(2)]
    wet = np.zeros((capture.rig.left.height, capture.rig.left.width), np.float32)
    for _ in range(DISCS):
        centre = tuple(int(rng.uniform(0.08, 0.92) * length) for length in wet.shape[::-1])
        cv2.circle(wet, centre, int(rng.uniform(*RADII_PX)), 1.0, -1)
    wet = cv2.GaussianBlur(wet, (0, 0), RADII_PX[0] / 4)
    for frame in capture.frames:
        sharp = capture.ir(frame, side).astype(np.float32)
        soft = cv2.GaussianBlur(sharp, (0, 0), DROPS[strength])
        cv2.imwrite(str(frame.path(side)), np.rint(sharp + wet * (soft - sharp)).astype(np.uint8))
    return {"side": side, "sigma_px": DROPS[strength], "share": round(float(wet.mean()), 4)}


def judged(args, name, strength, recording, done):
    """A row of the results. done: rows so far, of the recordings as they are first."""
    place = args.out / "_".join([recording.name, *([name, strength] if name else ["plain"])])
    row = {"recording": recording.name, "hidden": name, "strength": strength, "named": [], "verdict": "silent"}
    source, truth = recording, ()
    started = time.monotonic()
    try:
        if name is not None:
            source = place.with_name(place.name + "_recorded")
            if not source.exists():
                row["truth"] = hidden(recording, source, name, strength, args.seed)
            truth = ACCEPTED[name]
        if not place.exists():
            calibrate_world(source, place)
        result = diagnose(place, reference=args.reference).result
    except ValueError as error:
        return row | {"verdict": "refused", "why": str(error)}
    entries = {entry["effect"]: entry for entry in result["ranking"]}
    row["named"] = [effect for effect in result["added"] if effect != OWN]
    row["nats"] = [round(entries[effect]["score_nats"], 1) for effect in row["named"]]
    row["exponent"] = round(entries[OWN]["parameters"]["exponent"]["value"], 2) if OWN in entries else None
    row["seconds"] = round(time.monotonic() - started, 1)
    if name == OWN:  # more of what every lens has
        grown = row["exponent"] - next(r["exponent"] for r in done if r["recording"] == recording.name)
        row["verdict"] = "right" if abs(grown - row["truth"]["exponent"]) < EXPONENT_SD * 3.0 else "silent"
    if row["named"]:
        row["verdict"] = "right" if row["named"][0] in truth else "wrong"
    return row


if __name__ == "__main__":
    main()
