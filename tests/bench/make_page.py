#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes README.md and targets.svg of the benchmarks, and examples/guide/figures.md, from results/*.json.

    python3 tests/bench/make_page.py            # writes all three
    python3 tests/bench/make_page.py --check    # fails where a page is not what the results say

A file of results has a title, and runs: each with its command, machine, date, number of repetitions n, columns (name,
unit and, where one is set, the target) and rows of values. A value is a number, a range of two, a text, or null.
"""

import json
import sys
from pathlib import Path

from figures import PAGE, ROOT, figures_page

FOLDER = Path(__file__).resolve().parent
RESULTS = FOLDER / "results"
CHAPTERS = {
    "Rendering": ("first_image", "render", "mitsuba", "denoise", "cancel"),
    "Matching": ("matcher", "matcher_vulkan", "accuracy", "pairs", "subpixel", "invented"),
    "Sensor": ("sensor", "gbuffer", "gbuffer_gpu", "camera", "realism", "noise_profiles", "generate"),
    "Calibration": ("calibrate", "materials"),
}
HEAD = """# Benchmarks

`make_page.py` writes this page from [results](results); n is 1 unless stated. Compare within one table.
`cmake -DACTIVESTEREO_BENCH=ON` builds the C++ programs; Python's need `PYTHONPATH=build/python`.
"""
PICTURES = {
    "accuracy": "![Rendered](accuracy_rendered.png) ![Real](accuracy_real.png) ![Pixel locking](pixel_locking.png)",
    "subpixel": "![Bias by fraction](subpixel.png)",
    "denoise": "![2 and 32 plain samples, 2 filtered, 256](denoise.png)",
}


def main(arguments):
    pages = {FOLDER / "README.md": make_page(), PAGE: figures_page()}
    if arguments == ["--check"]:
        stale = [path for path, text in pages.items() if path.read_text() != text]
        for path in stale:
            print(f"{path.relative_to(ROOT)} is not what results/*.json say: run python3 tests/bench/make_page.py")
        return len(stale)
    draw_targets(FOLDER / "targets.svg")
    for path, text in pages.items():
        path.write_text(text)
    return 0


def make_page():
    """The page as text."""
    machines = _read("machines")
    lines = [HEAD, "|machine|parts|", "|--|--|", *(f"|`{name}`|{parts}|" for name, parts in machines.items()), ""]
    lines += ["![Times over targets](targets.svg)", ""]
    for chapter, names in CHAPTERS.items():
        lines += [f"## {chapter}", ""]
        for name in names:
            lines += _section(name, _read(name), machines)
    return "\n".join(lines).rstrip() + "\n"


def _section(name, results, machines):
    lines = [f"### {results['title']}", ""]
    if "about" in results:
        lines += [results["about"], ""]
    said = None
    for run in results["runs"]:
        if run["machine"] not in machines:
            raise ValueError(f"{name}.json names the machine '{run['machine']}', which machines.json does not describe")
        repeats = f", n = {run['n']}" if run["n"] != 1 else ""
        origin = f"`{_short(run['command'])}`, `{run['machine']}`, {run['date']}{repeats}"
        parts = [*([run["title"]] if "title" in run else []), *([origin] if origin != said else [])]
        lines += [f"{'; '.join(parts)}:", ""]
        said = origin
        lines += [*_table(run), ""]
    return [*lines, PICTURES[name], ""] if name in PICTURES else lines


def _short(command):
    return command.removeprefix("PYTHONPATH=build/python /usr/bin/python3 tests/bench/")


def _table(run):
    columns = run["columns"]
    rows = [f"||{'|'.join(map(_head, columns))}|", "|--" * (len(columns) + 1) + "|"]
    for case, values in run["rows"].items():
        if len(values) != len(columns):
            raise ValueError(f"'{case}' has {len(values)} values for {len(columns)} columns")
        rows.append(f"|{case}|{'|'.join(map(_text, values))}|")
    return rows


def _head(column):
    unit = f", {column['unit']}" if column["unit"] else ""
    return column["name"] + unit + (f" ({column['target']})" if "target" in column else "")


def _text(value):
    return "" if value is None else "-".join(map(str, value)) if isinstance(value, list) else str(value)


def draw_targets(path):
    """Draws each measured value over its target: of columns with an upper limit, and of those beside a `target`."""
    import matplotlib
    from matplotlib.figure import Figure

    ratios = _ratios()
    figure = Figure(figsize=(8, 0.6 + 0.2 * len(ratios)), facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    axes.barh(range(len(ratios)), [r for _, r in ratios], color=["#2f855a" if r <= 1 else "#c53030" for _, r in ratios])
    axes.axvline(1, color="#1f2933", lw=0.8)
    axes.set_xscale("log")
    axes.set_yticks(range(len(ratios)), [name for name, _ in ratios], size=7)
    axes.margins(y=0.01)
    axes.invert_yaxis()
    axes.set_xlabel("measured over target (1 or less reaches it)")
    axes.spines[["top", "right"]].set_visible(False)
    with matplotlib.rc_context({"svg.hashsalt": "targets", "svg.fonttype": "none"}):
        figure.savefig(path, metadata={"Date": None})


def _ratios():
    ratios = []
    for name in (name for names in CHAPTERS.values() for name in names):
        results = _read(name)
        for run in results["runs"]:
            for case, values in run["rows"].items():
                label = f"{results['title']}: {case}"
                ratios += [(f"{label}, {what}", r) for what, r in _over_targets(run["columns"], values)]
    return ratios


def _over_targets(columns, values):
    """(column, measured over target) for each value of a row that has an upper limit."""
    names = [column["name"] for column in columns]
    if "target" in names:
        place = names.index("target")
        return [(names[place - 1], values[place - 1] / values[place])]
    return [
        (column["name"], _largest(value) / float(column["target"].removeprefix("<= ")))
        for column, value in zip(columns, values, strict=True)
        if column.get("target", "").startswith("<= ")
    ]


def _largest(value):
    return max(value) if isinstance(value, list) else value


def _read(name):
    return json.loads((RESULTS / f"{name}.json").read_text())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
