# SPDX-License-Identifier: Apache-2.0
"""Draws the report's charts: error per frame, photon transfer, residual against covariates, error against effects
added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from activestereo.common.palette import BLUE, GREEN, GRID, INK, MUTED, ORANGE
from activestereo.compare.where import COVARIATES
from activestereo.diagnose.words import error_text
from activestereo.report.lettering import escape_dollars

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SPLIT_COLOR = {"train": BLUE, "test": ORANGE}
WORDS = {covariate.name: covariate.words for covariate in COVARIATES}
_COLUMNS = 4
_LEGEND_IN = 0.32
_RINGS = 12


def _axes(
    figure: Figure, *place: Any, x: str | None = None, y: str | None = None, title: str | None = None,
    grid: Any = "both",
) -> Axes:  # fmt: skip
    axes = figure.add_subplot(*place)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GRID)
    axes.tick_params(labelsize=8, colors=MUTED, length=0)
    axes.grid(axis=grid, color=GRID, lw=0.7)
    axes.set_axisbelow(True)
    for setter, words in ((axes.set_xlabel, x), (axes.set_ylabel, y)):
        if words:
            setter(words, size=8.5, color=MUTED)
    if title:
        axes.set_title(title, size=9.5, color=INK, loc="left", weight="bold")
    return axes


def _legend(axes: Axes, **place: Any) -> None:
    axes.legend(frameon=False, fontsize=8.5, labelcolor=INK, **place)


def frames_chart(scores: Mapping[str, Any]) -> Figure:
    """Draws a bar for each frame's RMSE with its noise floor: infrared in DN, and disparity in pixels if the device
    gave depth. scores: compare.json's contents."""
    infrared = [(e["id"], e["split"], e["rmse_dn"], e["noise_floor_dn"]) for e in scores["frames"]]
    depth = [(e["id"], s, e["rmse_px"], e["noise_floor_px"]) for s, v in scores["depth"].items() for e in v["frames"]]
    panels = [("Infrared RMSE, DN", infrared)] + ([("Disparity RMSE, px", sorted(depth))] if depth else [])
    figure = Figure(figsize=(11.2, 2.5), layout="constrained")
    for index, (title, rows) in enumerate(panels):
        axes = _axes(figure, 1, len(panels), index + 1, x="frame", title=title, grid="y")
        for i, (_, split, value, floor) in enumerate(rows):
            axes.bar(i, value or 0.0, width=0.66, color=_SPLIT_COLOR[split])
            if floor is not None:
                axes.hlines(floor, i - 0.42, i + 0.42, color=INK, lw=1.8)
        axes.set_xticks(range(len(rows)), [str(row[0]) for row in rows])
        if index == 0:
            for split in scores["ir"]:
                axes.bar(0, 0, color=_SPLIT_COLOR[split], label=split)
            axes.plot([], [], color=INK, lw=1.8, label="noise floor")
            _legend(axes, ncol=3, loc="lower right", bbox_to_anchor=(1.0, 0.99), borderaxespad=0.1)
    return figure


def photon_transfer_chart(points: Sequence[Mapping[str, float]], noise: Mapping[str, float]) -> Figure:
    """Plots the temporal variance of repeated frames against their mean signal, with the fitted noise model. points:
    [{gain, mean_dn, variance_dn2}]. noise: the model's terms {offset, shot, relative, black_dn}."""
    figure = Figure(figsize=(5.4, 3.1), layout="constrained")
    axes = _axes(figure, 1, 1, 1, x="mean signal, DN", y="temporal variance, DN²", title="Photon transfer")
    gains = sorted({p["gain"] for p in points})
    for gain, color in zip(gains, [BLUE, ORANGE, GREEN] * len(gains), strict=False):
        own = [p for p in points if p["gain"] == gain]
        means, variances = ([p[name] for p in own] for name in ("mean_dn", "variance_dn2"))
        axes.plot(means, variances, ".", color=color, ms=5, label=f"repeats, gain {gain:g}")
        mean = np.linspace(min(means), max(means), 100)
        signal = np.maximum(mean - noise["black_dn"], 0.0)
        variance = noise["offset"] + noise["shot"] * gain * signal + noise["relative"] * signal**2
        axes.plot(mean, variance, color=color, lw=1.2)
    axes.plot([], [], color=MUTED, lw=1.2, label="fitted noise model")
    _legend(axes, loc="upper left")
    return figure


def covariates_chart(tables: Sequence[Mapping[str, Any]], unit: str) -> Figure:
    """Plots RMSE and mean residual in bins of covariates, such as depth or radius, with 95 % intervals and the noise
    floor. tables: entries of compare.json's "where", a panel for each. unit: the residual's."""
    columns = min(len(tables), _COLUMNS)
    rows = -(-len(tables) // columns)
    height_in = 2.35 * rows + _LEGEND_IN
    figure = Figure(figsize=(11.2 if columns > 1 else 4.4, height_in))
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - _LEGEND_IN / height_in))
    for index, entry in enumerate(tables):
        name = WORDS[entry["covariate"]]
        x_label = f"{name}{', ' + entry['covariate_unit'] if entry['covariate_unit'] else ''}"
        axes = _axes(figure, rows, columns, index + 1, x=x_label, y=unit if index % columns == 0 else None)
        _draw_bins(axes, entry["bins"])
    lines, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(lines, labels, loc="upper left", ncol=3, frameon=False, fontsize=9, labelcolor=INK)
    return figure


def _draw_bins(axes: Axes, bins: Sequence[Any]) -> None:
    categories = "label" in bins[0]
    has_marks = categories or len(bins) < 6  # few bins make no curve
    x = np.arange(len(bins)) if has_marks else np.array([(b["low"] + b["high"]) / 2 for b in bins])
    mean, rmse, floor = (np.array([b[key] for b in bins]) for key in ("mean", "rmse", "noise_floor"))
    excess = np.array([b["excess_interval"] for b in bins]).T
    low, high = np.sqrt(np.maximum(0.0, excess + floor**2))
    mean_low, mean_high = np.array([b["mean_interval"] for b in bins]).T
    axes.axhline(0.0, color=MUTED, lw=0.7)
    if has_marks:
        far = np.maximum(0, [[rmse - low, high - rmse], [mean - mean_low, mean_high - mean]])
        axes.errorbar(x, rmse, far[0], fmt="o", ms=4, color=BLUE, lw=1.4, label="RMSE")
        axes.errorbar(x, mean, far[1], fmt="s", ms=3.5, color=ORANGE, lw=1.4, label="mean residual")
        axes.hlines(floor, x - 0.4, x + 0.4, color=INK, lw=1.4, label="noise floor")
        names = [escape_dollars(b.get("label", f"{b.get('low', 0):.4g}")) for b in bins]
        style: Any = {"rotation": 40, "ha": "right", "size": 7} if categories else {"size": 8}
        axes.set_xticks(x, names, **style)
        axes.set_xlim(-0.6, len(bins) - 0.4)
        return
    axes.fill_between(x, low, high, color=BLUE, alpha=0.22, lw=0)
    axes.plot(x, rmse, color=BLUE, lw=1.5, label="RMSE")
    axes.fill_between(x, mean_low, mean_high, color=ORANGE, alpha=0.25, lw=0)
    axes.plot(x, mean, color=ORANGE, lw=1.3, label="mean residual")
    axes.plot(x, floor, color=INK, lw=1.3, ls=(0, (4, 2)), label="noise floor")


def falloff_chart(models: Mapping[str, tuple[NDArray, NDArray]]) -> Figure:
    """Plots the mean residual in bins of the angle to the optical axis. models: {name: (tangent of each pixel's angle,
    residual in DN, NaN where unknown)}; bins hold equally many pixels."""
    figure = Figure(figsize=(4.9, 2.5), layout="constrained")
    axes = _axes(figure, x="angle to the optical axis, degrees", y="DN", title="Mean of measured − model")
    axes.axhline(0.0, color=INK, lw=0.9)
    for (name, (off_axis, residual)), color in zip(models.items(), (ORANGE, BLUE), strict=False):
        known = np.isfinite(residual)
        order = np.argsort(off_axis[known])
        bins = [np.array_split(values[known][order], _RINGS) for values in (np.degrees(np.arctan(off_axis)), residual)]
        axes.plot(*([float(part.mean()) for part in own] for own in bins), "o-", color=color, lw=2, ms=4, label=name)
    _legend(axes, loc="best")
    return figure


def effects_chart(steps: Sequence[Mapping[str, Any]], floor: float | None) -> Figure:
    """Plots the held-out infrared error against the number of added effects, with the noise floor. steps: [{effects,
    heldout_ir_rmse}], beginning without effects. floor: DN or None."""
    figure = Figure(figsize=(4.9, 2.5), layout="constrained")
    axes = _axes(figure, 1, 1, 1, y="held-out infrared RMSE, DN", title="Error against effects added", grid="y")
    told = [step["heldout_ir_rmse"] for step in steps]
    error = [value if floor is None else max(value, floor) for value in told]
    axes.plot(range(len(error)), error, "o-", color=BLUE, lw=2, ms=8)
    for i, value in enumerate(told):
        said = error_text(value, floor, 2)
        axes.annotate(said, (i, error[i]), (0, 9), textcoords="offset points", ha="center", size=9.5, color=INK)
    if floor is not None:
        axes.axhline(floor, color=INK, lw=1.4, ls=(0, (4, 2)))
        said = f"noise floor {floor:.2f}"
        axes.annotate(said, (-0.45, floor), (0, -12), textcoords="offset points", size=9, color=INK)
    axes.set_ylim(0.0, 1.18 * max(error))
    axes.set_xlim(-0.5, max(len(error) - 0.5, 0.5))
    names: list[str] = []  # the effects that each step added or removed
    for i, step in enumerate(steps):
        now, old = step["effects"], steps[i - 1]["effects"] if i else []
        changes = [f"+ {name}" for name in now if name not in old] + [f"− {name}" for name in old if name not in now]
        names.append("\n".join(changes) or ("refitted" if i else "base model"))
    axes.set_xticks(range(len(error)), names, size=9, color=INK)
    return figure
