#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Known effects in recordings of rooms, in a user's order: they are in the camera while it measures the room.

    python3 tests/benchmark_suite/measured_rooms.py OUT RECORDING... [--kind gain] [--strength strong] [--reference DIR]
    python3 tests/benchmark_suite/measured_rooms.py OUT --rooms 4 --seed 7 --jobs 32

Each RECORDING is a capture that 'activestereo import' made, of two views or more; `--rooms` draws some, of two and
three views in turn (tests/python/shared/room_worlds.py). All are measured as they are. Then the kinds of 'activestereo
benchmark inject', and drops on a window, go into their images, on one recording after the other, before calibrate world
and diagnose. OUT/results.json has a row for each: whether the plan of the measured room tells an effect of that size,
which stands there for all rows before the first diagnosis; then the names beside the lens's falloff, nats, seconds.
"""

import argparse
import contextlib
import io
import json
import multiprocessing
import os
import shutil
import sys
import time
from functools import partial
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "python" / "shared"))

from inject.inject import plan, write_injected
from inject.kinds import KINDS
from room_worlds import BASELINE_M, CX, CY, F, Room
from activestereo.calibrate.world import cells
from activestereo.calibrate.world.world import calibrate_world
from activestereo.capture.capture import SIDES, read_capture
from activestereo.cli import main as command
from activestereo.diagnose import diagnose
from activestereo.diagnose.room.names import score_room
from activestereo.diagnose.room.plan import detectable_sizes
from activestereo.effects import builtin

OWN = "vignetting"  # every lens has it: a stronger one shows as a larger exponent, not as a further name
EXPONENT_SD = 0.25  # standard deviation of the exponent from one pair of views
# Drops on one camera's window: discs in which the image is blurred by this many pixels, the same in every view.
DROPS, DISCS, RADII_PX = {"medium": 1.5, "strong": 3.0}, 6, (25, 60)
# Drawn rooms have the first two views or all three: degrees turned, and exposure.
TURNS, EXPOSURES = ((0, 0), (14, 3), (-13, -4)), (1.0, 0.85, 1.3)
ACCEPTED = {name: kind.accepted for name, kind in KINDS.items()} | {"drops": ("focus_mismatch",)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("recordings", type=Path, nargs="*")
    parser.add_argument("--rooms", type=int, default=0, help="number of drawn rooms")
    parser.add_argument("--kind", action="append", choices=sorted(ACCEPTED), help="default: all")
    parser.add_argument("--strength", action="append", help="default: medium and strong")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--reference", type=Path, action="append", default=[], help="a measured room of the same unit")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    views = [2 + room % 2 for room in range(args.rooms)]
    args.recordings += [recorded(args.out / f"room{room}_{count}_views", args.seed + room, TURNS[:count],
                                 EXPOSURES[:count]) for room, count in enumerate(views)]  # fmt: skip
    rows = [None] * len(list(cases(args)))
    for number, row in in_parallel(partial(measured, args), list(enumerate(cases(args))), args.jobs):
        rows[number] = row
    write(args.out, rows)
    for number, row in in_parallel(partial(answered, args), list(enumerate(rows)), args.jobs):
        rows[number] = row
        print(json.dumps(row), flush=True)
        write(args.out, rows)
    rows = [grown(row, rows) if row["hidden"] == OWN and "exponent" in row else row for row in rows]
    write(args.out, rows)
    hidden = [row for row in rows if row["hidden"] is not None]
    told = [row for row in hidden if row["told"]]
    plain = [row for row in rows if row["hidden"] is None]
    right, of_told, in_set, wrong = (
        sum(row["verdict"] == verdict for row in some)
        for some, verdict in ((hidden, "right"), (told, "right"), (hidden, "in a set"), (hidden, "wrong"))
    )
    named = sum(row["verdict"] == "wrong" for row in plain)
    print(f"{right} of {len(hidden)} right, {in_set} in a set, {wrong} wrong; {of_told} of {len(told)} that the "
          f"plan tells; nothing hidden: {len(plain)} rooms, {named} with a name")  # fmt: skip


def in_parallel(function, items, jobs):
    """Yields function(item) of all items as they are done, in `jobs` processes of one thread each."""
    if jobs == 1:
        yield from map(function, items)
        return
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")  # the children read them
    with multiprocessing.get_context("spawn").Pool(jobs, cv2.setNumThreads, (1,)) as pool:
        yield from pool.imap_unordered(function, items)


def recorded(folder, seed, turns, exposures, session=0):
    """Draws a room, writes its views and imports them as a capture into `folder`, which it returns. turns: degrees of
    each view; exposures: relative; session: number of the visit to the same room."""
    room = Room(turns_deg=turns, exposures=exposures, seed=seed, session=session)
    views = room.write(folder.with_name(folder.name + "_views"))
    stated = ["--k", f"{F},{F},{CX},{CY}", "--baseline", str(BASELINE_M), "--depth-scale", "0.0001"]
    stated += ["--exposure", ",".join(str(0.008 * exposure) for exposure in exposures)]
    with contextlib.redirect_stdout(io.StringIO()):
        assert command(["import", str(views), "--sensor", "d415", *stated, "-o", str(folder)]) == 0
    return folder


def write(out, rows):
    (out / "results.json").write_text(json.dumps(rows, indent=1) + "\n")


def cases(args):
    """Yields (kind, strength, recording): each recording unchanged, then every kind and strength on one in turn."""
    for recording in args.recordings:
        yield None, None, recording
    number = 0
    for strength in args.strength or ("strong", "medium"):
        for name in args.kind or ACCEPTED:
            yield name, strength, args.recordings[number % len(args.recordings)]
            number += 1


def hidden(recording, out, name, strength, seed):
    """Writes a copy of the recording with the effect `name` in its images. Returns the effect's true parameters."""
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


def measured(args, numbered):
    """Measures the recording of one numbered case with calibrate world and returns (number, its result row without a
    diagnosis). row["told"]: whether the plan of the measured room says that an effect of this size can be told."""
    number, (name, strength, recording) = numbered
    place = args.out / "_".join([recording.name, *([name, strength] if name else ["plain"])])
    row = {"recording": recording.name, "place": place.name, "hidden": name, "strength": strength, "told": False}
    source, started = recording, time.monotonic()
    try:
        if name is not None:
            source = place.with_name(place.name + "_recorded")
            truth = place.with_name(place.name + "_truth.json")
            if not source.exists():
                truth.write_text(json.dumps(hidden(recording, source, name, strength, args.seed)))
            row["truth"] = json.loads(truth.read_text())
        if not place.exists():
            calibrate_world(source, place)
        if name is not None:
            capture = read_capture(place)
            tells = detectable_sizes(score_room(cells.Room(capture), builtin()))
            row["told"], row["least"] = is_told(tells, name, row["truth"], capture)
    except ValueError as error:
        return number, row | {"verdict": "refused", "why": str(error)}
    return number, row | {"seconds": round(time.monotonic() - started, 1)}


def is_told(tells, name, truth, capture):
    """Returns whether a plan can tell an effect of this size, and the least sizes that it can tell. tells: {effect:
    {parameter: least size}}; truth: the hidden effect's parameters."""
    light = np.mean([capture.ir(f, side).mean() for f in capture.frames for side in SIDES]) / capture.rig.max_dn
    effect, sizes = {
        "blur": lambda: ("focus_mismatch", {"sigma_px": truth["radius_px"] / 2.0}),  # a disc's deviation along one axis
        "drops": lambda: ("drops on a window", truth),
        "veiling_glare": lambda: ("veiling_glare", truth),
        "ghost": lambda: ("lens_ghost", truth),
        "gain": lambda: ("gain_mismatch", {"gain": truth["excess"]}),
        "black_level": lambda: ("gain_mismatch", truth),
        "radial_distortion": lambda: ("radial_distortion", truth),
        "tangential_distortion": lambda: ("tangential_distortion", {
            "p1": truth["size"] * np.sin(truth["direction_rad"]), "p2": truth["size"] * np.cos(truth["direction_rad"]),
        }),
        "bands": lambda: ("flicker_banding", truth),
        "row_noise": lambda: ("row_noise", truth),
        "dead_dots": lambda: ("dot_gain_spread", {}),
        "vignetting": lambda: ("vignetting", truth),
        "response": lambda: ("response_gamma", {"log_exponent": np.log1p(truth["compression"] * light)}),
    }[name]()  # fmt: skip
    least = tells.get(effect, {})
    each = [abs(sizes[parameter]) >= size for parameter, size in least.items() if parameter in sizes]
    return bool(each) and (all if name == "drops" else any)(each), dict(least)


def answered(args, numbered):
    """Diagnoses the measured room of a numbered row. Returns (number, the row with the named effects and verdict)."""
    (number, row), started = numbered, time.monotonic()
    if "why" in row:
        return number, row
    result = diagnose(args.out / row["place"], reference=args.reference).result
    entries = {entry["effect"]: entry for entry in result["ranking"]}
    row = row | {"named": [effect for effect in result["added"] if effect != OWN], "verdict": "silent"}
    row["nats"] = [round(entries[effect]["score_nats"], 1) for effect in row["named"]]
    row["exponent"] = round(entries[OWN]["parameters"]["exponent"]["value"], 2) if OWN in entries else None
    row["seconds"] = round(row["seconds"] + time.monotonic() - started, 1)
    if row["named"]:
        accepted = ACCEPTED.get(row["hidden"], ())
        alike = {member for each in result["sets"] if row["named"][0] in each["effects"] for member in each["effects"]}
        row["verdict"] = "right" if row["named"][0] in accepted else "in a set" if alike & {*accepted} else "wrong"
    return number, row


def grown(row, rows):
    """Returns the row of a hidden falloff, right where the exponent grows beyond the unchanged recording's."""
    plain = next(r["exponent"] for r in rows if r["hidden"] is None and r["recording"] == row["recording"])
    is_found = not row["named"] and abs(row["exponent"] - plain - row["truth"]["exponent"]) < EXPONENT_SD * 3.0
    return row | {"verdict": "right"} if is_found else row


if __name__ == "__main__":
    main()
