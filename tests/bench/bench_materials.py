# SPDX-License-Identifier: Apache-2.0
"""How well `calibrate materials` finds paints, and whether its intervals hold the truth: things rendered by kuafu.

    PYTHONPATH=build/python:tests/python/shared python3 tests/bench/bench_materials.py [--only ball-metal box-gloss ...]

A ball, a box and a cup of each paint, and a box whose colour the scene does not know, stand on a table of known albedo
under two lamps. Two poses of the camera see them at 200 x 150 px with the projector on, with it off, and in colour,
with shot and read noise. Asked: what is determined within 0.1 (specular 0.2), the truth in the 90 % intervals in 0.85
of them. Processes of their own, each with --only, share a machine of many cores; --append FILE gathers what they found
as lines of JSON, and --table FILE prints the table of such a file.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

from material_worlds import COLOR, record

from activestereo.calibrate.material_fit import PARAMETERS
from activestereo.calibrate.materials import calibrate_materials

# roughness, metallic, specular, transmission, ir_albedo
PAINTS = {
    "gloss": (0.2, 0.0, 1.0, 0.0, 0.5), "plastic": (0.35, 0.0, 1.0, 0.0, 0.5), "metal": (0.3, 1.0, 1.0, 0.0, 0.68),
    "dark": (0.8, 0.0, 0.5, 0.0, 0.08),
}  # fmt: skip
WHITE = (1.0, 1.0, 1.0)
OBJECTS = {f"{shape}-{paint}": (shape, paint, COLOR) for shape in ("ball", "box", "cup") for paint in PAINTS}
OBJECTS |= {f"box-{paint}-uncoloured": ("box", paint, WHITE) for paint in ("plastic", "metal")}
LIMITS = {"specular": 0.2}


def measured(name: str, spp: int, poses: int) -> dict[str, Any]:
    """The findings on one object; `found`: {parameter: [truth, value, low, high], [truth] if named undetermined}."""
    shape, paint, known = OBJECTS[name]
    with tempfile.TemporaryDirectory() as folder:
        path = record(Path(folder) / "world", PAINTS[paint], samples=spp, poses=poses, shape=shape, nominal_color=known)
        begin, cpu = time.monotonic(), time.process_time()
        found = calibrate_materials(path, shape)
        out: dict[str, Any] = {"name": name, "s": time.monotonic() - begin, "cpu_s": time.process_time() - cpu}
    (fields,) = found.found.values()
    out["loss"] = found.loss[1]
    out["found"] = {
        parameter: [truth, *((q.value, q.low, q.high) if (q := fields.get(parameter)) else ())]
        for parameter, truth in zip(PARAMETERS, PAINTS[paint])
    }
    return out


def row(result: dict[str, Any]) -> str:
    cells = []
    for parameter, (truth, *told) in result["found"].items():
        if not told:
            cells.append(f"{truth:g}: open")
        else:
            value, low, high = told
            far = "!" if abs(value - truth) > LIMITS.get(parameter, 0.1) else ""
            out = "" if low <= truth <= high else "*"
            cells.append(f"{truth:g}: {value:.2f} ({low:.2f} to {high:.2f}){far}{out}")
    cells += [f"{result['loss']:.2f}", f"{result['s']:.0f} / {result['cpu_s']:.0f}"]
    return f"| {result['name']} | {' | '.join(cells)} |"


def summary(results: list[dict[str, Any]]) -> str:
    told = [
        (parameter, truth, *rest) for result in results for parameter, (truth, *rest) in result["found"].items() if rest
    ]
    near = sum(abs(value - truth) <= LIMITS.get(parameter, 0.1) for parameter, truth, value, _, _ in told)
    held = sum(low <= truth <= high for _, truth, _, low, high in told)
    total = sum(len(result["found"]) for result in results)
    return (
        f"{len(told)} of {total} values are determined; {near} of them within 0.1 (specular 0.2), "
        f"{held} in their 90 % interval ({held / max(len(told), 1):.2f}; asked: 0.85)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=list(OBJECTS), choices=list(OBJECTS), metavar="NAME")
    parser.add_argument("--spp", type=int, default=512, help="of the recorded pictures")
    parser.add_argument("--poses", type=int, default=2)
    parser.add_argument("--append", type=Path, metavar="FILE", help="also write what is found as a line of JSON")
    parser.add_argument("--table", type=Path, metavar="FILE", help="measure nothing; print the table of such a file")
    args = parser.parse_args()
    print(f"| object | {' | '.join(PARAMETERS)} | loss | s / CPU s |\n|{'--|' * (len(PARAMETERS) + 3)}")
    results = []
    if args.table:
        results = [json.loads(line) for line in args.table.read_text().splitlines()]
        results.sort(key=lambda result: list(OBJECTS).index(result["name"]))
        print("\n".join(map(row, results)))
    else:
        for name in args.only:
            results.append(measured(name, args.spp, args.poses))
            print(row(results[-1]), flush=True)
            if args.append:
                args.append.parent.mkdir(parents=True, exist_ok=True)
                with args.append.open("a") as file:
                    file.write(json.dumps(results[-1]) + "\n")
    print("\ntruth: found (90 % interval); open = named as not determined, ! = too far off, * = truth outside")
    print(summary(results))


if __name__ == "__main__":
    main()
