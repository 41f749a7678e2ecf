# SPDX-License-Identifier: Apache-2.0
"""The matchers' scores as JSON, tables and a picture."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from matchers.pairs import MATERIALS
from matchers.score import EMITTERS, Score
from activestereo.common.output_files import replace_file, write_text

Scores = dict[str, dict[str, dict[str, Score]]]
_COLORS = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377", "#bbbbbb")


def write_report(scores: Scores, out: Path, about: dict[str, object]) -> None:
    """matchers.json, matchers.md and matchers.png."""
    plain = {
        name: {e: {m: asdict(score) for m, score in of.items()} for e, of in own.items()}
        for name, own in scores.items()
    }
    write_text(out / "matchers.json", json.dumps(about | {"matchers": plain}, indent=1) + "\n")
    write_text(out / "matchers.md", "\n".join(table(scores)) + "\n")
    _write_picture(scores, out / "matchers.png")


def table(scores: Scores) -> list[str]:
    """Lines of Markdown: what each matcher loses, unmeasured or off by more than a pixel, by material in percent."""
    head = ("matcher", "projector", "measured, %", "wrong of these, %", "error of right ones, px", "lost, %: all")
    lines = [f"| {' | '.join((*head, *MATERIALS))} |", "|---" * (len(head) + len(MATERIALS)) + "|"]
    for name, own in scores.items():
        for emitter in EMITTERS:
            of, whole = own[emitter], own[emitter]["all"]
            first = f"{100 * whole.measured:.1f} | {100 * whole.wrong:.2f} | {whole.spread_px:.3f}"
            lost = " | ".join(f"{100 * of[material].lost:.1f}" for material in ("all", *MATERIALS))
            lines.append(f"| {name} | {emitter} | {first} | {lost} |")
    return lines


def _write_picture(scores: Scores, path: Path) -> None:
    from matplotlib.figure import Figure

    picture = Figure(figsize=(10.0, 8.0))
    groups = ("all", *MATERIALS)
    width = 0.8 / len(scores)
    for axes, emitter in zip(picture.subplots(len(EMITTERS), 1, sharex=True), EMITTERS, strict=True):
        for number, (name, own) in enumerate(scores.items()):
            lost = [100 * own[emitter][group].lost for group in groups]
            at = np.arange(len(groups)) + (number - 0.5 * (len(scores) - 1)) * width
            axes.bar(at, lost, width, label=name, color=_COLORS[number % len(_COLORS)])
        axes.set(ylabel="lost, %", title=f"projector {emitter}", ylim=(0, 100))
        axes.set_xticks(range(len(groups)), groups, rotation=20)
    picture.axes[0].legend(ncols=3, fontsize=8, frameon=False)
    picture.tight_layout()
    replace_file(path, lambda file: picture.savefig(file, format="png", dpi=110))
