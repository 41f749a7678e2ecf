#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the benchmark suite's README.md from results/*.json.

    python3 tests/benchmark_suite/make_page.py            # writes it
    python3 tests/benchmark_suite/make_page.py --check    # fails if it differs from the results

results/generation-NN.json holds the measures of a run's score.json with its command, machine, date and number n of
test cases, and a note on how it ran. mitsuba.json has those of worlds that Mitsuba renders, and next.json the output of
run_next.py, from the search before this one.
practice.json is the output of practice.py. causes.json explains wrong answers.
"""

import json
import sys
from pathlib import Path

from suite_bars import BARS

FOLDER = Path(__file__).resolve().parent
RESULTS = FOLDER / "results"
HEAD = """# The benchmark suite

Does `activestereo diagnose` find an effect that it does not know? An independent virtual sensor
(`tests/support/virtual_sensor/held_out`) makes small captures (212x120, 8 frames) with something hidden in them, writes
the answer key elsewhere, runs the tool on the capture alone, and scores what it says.

    python3 tests/benchmark_suite/run_suite.py --set small --out out/suite     # 12 fixed test cases
    python3 tests/benchmark_suite/run_suite.py --set all --jobs 2 --out out/suite-all

`--generation N` makes other test cases of the same kinds by another seed. `--only NAME...` takes test cases by id or by
an effect that they hide. A run goes on after a stop. `DIR/README.md` is its score page, `score.json` holds the numbers,
and `keys/` the truth.

| set | test cases | hidden |
|---|---|---|
| single | 156 | 39 effects at four strengths: below the floor, weak, medium, strong |
| pairs | 40 | two effects, 11 times twins that resemble each other |
| wider | 14 | 7 effects that the library got later, medium and strong |
| filters | 4 | what a device's firmware does to good depth, medium and strong: no fault, and not in `all` |
| outside | 24 | 12 effects that no library has, medium and strong |
| none | 100 | nothing |
| mitsuba | 28 | 18 effects, 4 that no library has, and nothing, in worlds that Mitsuba 3 renders; not in `all` |
| depth | 12 | faults of the device's depth engine; captures without infrared images |

The sensor shares no code with the product: it has ray casting in closed form, radiosity, PCG64 random numbers, and
writers and a depth engine of its own. Where physics allows, hidden effects follow other formulas than the product's: a
hexagonal aperture, a disc for lens blur, a division model of distortion, a rectified sine. The capture's object
positions, angles, albedos and focal lengths have uniform errors of up to 1 mm, 0.25 deg, 3 % and 0.1 %.

Strength is the error that an effect leaves on test frames, over the noise floor, in quadrature: about 0.15, 0.4, 0.9
and 2. An effect counts as detectable from 0.5 on. Test cases call a lamp in the room `ambient_ir`; the library's
`external_light` is the same physics and a right answer. A fault of the depth engine that any other matcher shares is
not a fault of the sensor: there `none` is right.

`python3 tests/benchmark_suite/make_page.py` writes this page from [results](results).
"""
BOUND = (
    "Errors of the scene measurement bound the error fall F: in test case g1-none-000 they leave 0.054 of the noise",
    "variance, so that an F of 0.88 is the most for a medium effect, where exact measurements would allow 0.94.",
)


def main(arguments):
    page = make_page()
    if arguments == ["--check"]:
        if (FOLDER / "README.md").read_text() != page:
            print("README.md is not what results/*.json say: run python3 tests/benchmark_suite/make_page.py")
            return 1
        return 0
    (FOLDER / "README.md").write_text(page)
    return 0


def make_page():
    """Returns the benchmark suite's README.md as text."""
    [run] = [json.loads(path.read_text()) for path in RESULTS.glob("generation-*.json")]
    lines = [HEAD, "## How often it is right", "", *_measures(run), "", *_strengths(run["by_strength"]), ""]
    lines += ["![Answers by strength](answers.png)", "", "![Truth against the first name](confusion.png)", ""]
    lines += ["![Stated confidence against how often it was right](calibration.png)", ""]
    lines += ["## What goes wrong", ""]
    causes = ("hidden", "answer", "cause")
    lines += [*_table(causes, ([record[key] for key in causes] for record in _read("causes"))), "", *BOUND]
    lines += ["", *_another_renderer(_read("mitsuba"))]
    return "\n".join([*lines, "", *_next(_read("next")), "", *_practice(_read("practice"))]) + "\n"


def _measures(run):
    lines = [
        f"{run['n']} of the 346 test cases of generation {run['generation']}, drawn after the code was frozen and "
        f"opened once ({run['date']}, {run['machine']}{run['note']}); brackets hold the 95 % interval and n:",
        "",
        f"    {run['command']}",
        "",
    ]
    rows = []
    for name, measure in run["measures"].items():
        sign, bar, aim = BARS.get(name, ("", "", ""))
        rows.append((name, f"{sign}{bar}", f"{sign}{aim}", _value(measure)))
    return [*lines, *_table(("measure", "bar", "aim", "measured"), rows)]


def _table(head, rows):
    return [f"|{'|'.join(head)}|", "|--" * len(head) + "|", *(f"|{'|'.join(row)}|" for row in rows)]


def _value(measure):
    if measure is None:
        return ""
    text = f"{measure['value']:.3g}"
    return text if measure["low"] is None else f"{text} ({measure['low']:.2g}-{measure['high']:.2g}; {measure['n']})"


def _strengths(by_strength):
    measures = list(next(iter(by_strength.values())))
    rows = ((name, *(_value(part[key]) for key in measures)) for name, part in by_strength.items())
    return _table(("strength", *measures), rows)


def _another_renderer(run):
    return [
        "## Worlds of another renderer",
        "",
        f"{run['n']} of the {run['of']} worlds that Mitsuba 3 renders were answered, drawn after the code was frozen "
        f"({run['date']}, {run['machine']}):",
        "",
        f"    {run['command']}",
        "",
        *(f"- {name}: {_value(measure)}" for name, measure in run["measures"].items()),
    ]


def _next(run):
    shares = [f"{run[how]['resolved']} of {run[how]['n']}" for how in ("asked", "random")]
    return [
        "## The next measurement",
        "",
        "Where several names fit equally, the tool asks for one more measurement. By the search before this one, in "
        "ambiguous cases of generations "
        f"{', '.join(map(str, run['generations']))} its frames resolved {shares[0]}, and random frames {shares[1]}"
        f" ({run['date']}, {run['machine']}):",
        "",
        f"    {run['command']}",
    ]


def _practice(run):
    lines = [
        "## The practice captures",
        "",
        "Another program rendered nine captures (424x240, 12 frames). Gap is (before - after) / (before - floor) of "
        f"test errors ({run['date']}, {run['machine']}, n = {run['n']}):",
        "",
        f"    {run['command']}",
        "",
    ]
    rows = []
    for row in run["rows"]:
        gap, dn = "" if row["gap"] is None else f"{row['gap']:.2f}", (row["diagnosis_dn"], row["floor_dn"])
        rows.append((row["capture"], row["hidden"], row["answer"], gap, *(f"{value:.3f}" for value in dn)))
    found = run["parameters"]
    values = "; ".join(
        f"{r['parameter']} {r['found']:g} ({r['low']:g} to {r['high']:g}; truth {r['truth']:g})" for r in found["rows"]
    )
    return [
        *lines,
        *_table(("capture", "hidden", "answer", "gap", "after, DN", "floor, DN"), rows),
        "",
        f"Parameters of {found['capture']} with their 90 % intervals ({found['date']}, {found['machine']}): {values}.",
    ]


def _read(name):
    return json.loads((RESULTS / f"{name}.json").read_text())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
