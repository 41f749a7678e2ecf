# SPDX-License-Identifier: Apache-2.0
"""Writes the page of a benchmark run: README.md with the score table and every wrong answer, and its pictures."""

import numpy as np
from suite_bars import BARS
from matplotlib.figure import Figure

_GOOD, _FAIR, _BAD, _QUIET, _INK = "#2f855a", "#d69e2e", "#c53030", "#cbd5e0", "#1f2933"


def write_page(scores, results, folder, set_name):
    """Writes README.md, answers.png, confusion.png and calibration.png into `folder`. Returns the score table."""
    table = _table(scores["measures"])
    lines = [
        f"# The benchmark suite: set `{set_name}`, {len(results)} test cases",
        "",
        "Every case is a capture by an independent virtual sensor with an effect that the tool does not know. "
        "An effect counts as",
        "detectable where it raises the error on test frames by half a noise floor or more, in quadrature. "
        "Intervals: 95 %.",
        "",
        *table,
        "",
    ]
    if scores["by_strength"]:
        _answers_picture(scores["by_strength"]).savefig(folder / "answers.png", dpi=110)
        _confusion_picture(scores["by_strength"]).savefig(folder / "confusion.png", dpi=110)
        lines += [*_strength_table(scores["by_strength"]), ""]
        lines += ["![answers](answers.png)", "", "![confusion](confusion.png)", ""]
    if scores["calibration"]:
        _calibration_picture(scores["calibration"]).savefig(folder / "calibration.png", dpi=110)
        lines += ["![calibration](calibration.png)", ""]
    lines += _misses(results)
    (folder / "README.md").write_text("\n".join(lines) + "\n")
    return "\n".join(table)


def _table(measures):
    rows = ["| measure | value | 95 % interval | n | bar | aim | |", "|---|---|---|---|---|---|---|"]
    for name, m in measures.items():
        if not m["n"]:
            continue
        interval = "" if m["low"] is None else f"{m['low']:.3g} .. {m['high']:.3g}"
        bar, aim, mark = "", "", ""
        if name in BARS:
            sign, ship, best = BARS[name]
            reached = [(m["value"] >= x) if sign == ">=" else (m["value"] <= x) for x in (ship, best)]
            bar, aim = f"{sign} {ship}", f"{sign} {best}"
            mark = "aim" if reached[1] else "bar" if reached[0] else "**no**"
        rows.append(f"| {name} | {m['value']:.3g} | {interval} | {m['n']} | {bar} | {aim} | {mark} |")
    return rows


def _strength_table(by_strength):
    rows = ["| strength | top-1 | named and right | named and wrong | n |", "|---|---|---|---|---|"]
    for strength, part in by_strength.items():
        cells = " | ".join(
            f"{part[k]['value']:.2f} ({part[k]['low']:.2f}..{part[k]['high']:.2f})"
            for k in ("top-1", "named and right", "named and wrong")
        )
        rows.append(f"| {strength} | {cells} | {part['top-1']['n']} |")
    return rows


def _misses(results):
    """Returns Markdown lines of a table of the cases with a wrong answer."""
    rows = ["| case | truth | strength | error over floor | verdict | added | first three |", "|---" * 7 + "|"]
    for r in sorted(results, key=lambda r: r.key["id"]):
        if r.right:
            continue
        strength = " + ".join(r.key["strengths"].values())
        hidden, ratio = " + ".join(sorted(r.truth)), f"{r.key['oracle']['test']['ratio']:.2f}"
        found, first = ", ".join(sorted(r.added)), ", ".join(r.names(3))
        cells = (r.key["id"], hidden, strength, ratio, r.verdict, found, first)
        rows.append("| " + " | ".join(cells) + " |")
    return ["## Misses", "", *rows] if len(rows) > 2 else ["No misses."]


def _color(truth, answer):
    return _GOOD if answer == truth else _QUIET if answer in ("none", "undetermined", "unknown") else _BAD


def _answers_picture(by_strength):
    """Draws the answer for each effect (rows) at each strength (columns)."""
    effects = sorted({truth for part in by_strength.values() for truth in part["confusion"]})
    size = 3.2 + 2.3 * len(by_strength), 1.2 + 0.24 * len(effects)
    figure = Figure(figsize=size, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    for column, part in enumerate(by_strength.values()):
        for row, truth in enumerate(effects):
            answer = part["confusion"].get(truth)
            if answer is None:
                continue
            text, color = "found" if answer == truth else answer, _color(truth, answer)
            axes.add_patch(_cell(column, row, color))
            ink = _INK if color == _QUIET else "white"
            axes.text(column, row, text, ha="center", va="center", size=7.5, color=ink)
    axes.set_xlim(-0.5, len(by_strength) - 0.5)
    axes.set_ylim(len(effects) - 0.5, -0.5)
    axes.set_xticks(range(len(by_strength)), list(by_strength))
    axes.set_yticks(range(len(effects)), effects, size=8)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_title("hidden effect, and what was said of it", size=11, loc="left", color=_INK)
    return figure


def _cell(column, row, color):
    from matplotlib.patches import Rectangle

    return Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, color=color, lw=0)


def _confusion_picture(by_strength):
    truths = sorted({t for part in by_strength.values() for t in part["confusion"]})
    answers = [*truths, *sorted({a for part in by_strength.values() for a in part["confusion"].values()} - set(truths))]
    figure = Figure(figsize=(15, 14), facecolor="white", layout="constrained")
    for place, (strength, part) in enumerate(by_strength.items(), 1):
        axes = figure.add_subplot(2, 2, place)
        for truth, answer in part["confusion"].items():
            axes.add_patch(_cell(answers.index(answer), truths.index(truth), _color(truth, answer)))
        axes.set_xlim(-0.5, len(answers) - 0.5)
        axes.set_ylim(len(truths) - 0.5, -0.5)
        axes.set_xticks(range(len(answers)), answers, rotation=90, size=6)
        axes.set_yticks(range(len(truths)), truths, size=6)
        axes.grid(color="#e4e7eb", lw=0.4)
        axes.set_axisbelow(True)
        axes.set_title(f"{strength}: hidden (rows) against answered (columns)", size=10, loc="left")
    return figure


def _calibration_picture(bins):
    figure = Figure(figsize=(4.6, 4.2), facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color=_QUIET)
    n = np.array([b["n"] for b in bins])
    axes.scatter([b["stated"] for b in bins], [b["right"] for b in bins], s=20 + 4 * n, color=_FAIR, zorder=3)
    for b in bins:
        axes.annotate(str(b["n"]), (b["stated"], b["right"]), textcoords="offset points", xytext=(7, -3), size=8)
    axes.set_xlabel("stated confidence")
    axes.set_ylabel("share that was right")
    axes.spines[["top", "right"]].set_visible(False)
    return figure
