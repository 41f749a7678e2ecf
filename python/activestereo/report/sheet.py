# SPDX-License-Identifier: Apache-2.0
"""Draws compare.png: measured, simulated and residual images of each split's worst frame, and a bar chart of errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure

from activestereo.capture.capture import SIDES, SPLITS
from activestereo.common.palette import BLUE, GRID, INK, MUTED, ORANGE
from activestereo.report.lettering import escape_dollars
from activestereo.report.worst import known_residual, residual_limit, worst_frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from activestereo.compare.compare import Comparison

_BAR = {"train": BLUE, "test": ORANGE}


def comparison_figure(comparison: Comparison) -> Figure:
    """Draws the left images of each split's worst frame above a bar for each frame's error with its noise floor."""
    scores = comparison.scores
    rows = [worst_frame(scores, split)["id"] for split in SPLITS if split in scores["ir"]]
    figure = Figure(figsize=(13.5, 2.7 * len(rows) + 3.4), facecolor="white")
    grid = figure.add_gridspec(
        len(rows) + 1, 6, height_ratios=[*([2.7] * len(rows)), 1.9], width_ratios=[1, 1, 0.022, 0.035, 1, 0.022],
        left=0.055, right=0.955, top=0.86, bottom=0.085, wspace=0.07, hspace=0.22,
    )  # fmt: skip
    _title(figure, scores)
    for row, frame_id in enumerate(rows):
        _image_row(figure, grid, row, comparison, frame_id)
    _frame_chart(figure.add_subplot(grid[-1, :]), scores)
    return figure


def _title(figure: Figure, scores: dict[str, Any]) -> None:
    title = f"{escape_dollars(scores['capture'])}: measured against simulated infrared"
    figure.text(0.055, 0.955, title, size=15, weight="bold", color=INK)
    parts = []
    for split, values in scores["ir"].items():
        floor = values["noise_floor_dn"]
        above = "" if floor is None else f" (noise floor {floor:.2f}, explainable {values['explainable_rmse_dn']:.2f})"
        parts.append(f"{split} RMSE {values['rmse_dn']:.2f} DN{above}")
    figure.text(0.055, 0.918, "     ".join(parts), size=10.5, color=MUTED)


def _image_row(figure: Figure, grid: Any, row: int, comparison: Comparison, frame_id: int) -> None:
    entry = next(e for e in comparison.scores["frames"] if e["id"] == frame_id)
    frame = next(f for f in comparison.capture.frames if f.id == frame_id)
    measured = comparison.measured[frame_id, "left"]
    predicted = comparison.predictions[frame_id, "left"]
    high = float(np.quantile(measured, 0.998))
    residual = known_residual(comparison.capture, (frame_id, "left"), comparison.measured, comparison.predictions)
    limit = residual_limit(residual, entry["noise_floor_dn"])
    panels = (
        (0, "measured", measured, {"cmap": "gray", "norm": PowerNorm(0.5, 0, high)}),
        (1, "simulated (square-root scale)", predicted, {"cmap": "gray", "norm": PowerNorm(0.5, 0, high)}),
        (4, "measured - simulated", residual, {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit}),
    )
    for column, title, image, style in panels:
        axes = figure.add_subplot(grid[row, column])
        shown = axes.imshow(image, interpolation="nearest", aspect="equal", **style)
        axes.set_facecolor(MUTED)  # the background shows at pixels without known scene
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_color(GRID)
        if row == 0:
            axes.set_title(title, size=11, color=INK, loc="left")
        if column == 0:
            axes.set_ylabel(f"{frame.split}, frame {frame_id}, left", size=10, color=INK)
        if column:
            bar = figure.colorbar(shown, cax=figure.add_subplot(grid[row, column + 1]))
            bar.ax.tick_params(labelsize=8, colors=MUTED, length=2)
            bar.outline.set_edgecolor(GRID)
            bar.ax.set_title("DN", size=8, color=MUTED, pad=3)


def _frame_chart(axes: Axes, scores: dict[str, Any]) -> None:
    """Draws RMSE bars per frame and camera, each with the frame's noise floor."""
    for index, entry in enumerate(scores["frames"]):
        color = _BAR[entry["split"]]
        for offset, side in zip((-0.2, 0.2), SIDES, strict=True):
            values = entry["cameras"][side]
            axes.bar(index + offset, values["rmse_dn"], width=0.36, color=color, alpha=1.0 if side == "left" else 0.6)
            if values["noise_floor_dn"] is not None:
                axes.hlines(values["noise_floor_dn"], index + offset - 0.2, index + offset + 0.2, color=INK, lw=1.6)
    axes.set_xticks(range(len(scores["frames"])), [str(e["id"]) for e in scores["frames"]])
    axes.set_xlim(-0.6, len(scores["frames"]) - 0.4)
    axes.set_xlabel("frame (dark bar: left camera, light bar: right camera)", size=9, color=MUTED)
    axes.set_ylabel("IR RMSE, DN", size=9, color=MUTED)
    axes.tick_params(labelsize=9, colors=MUTED, length=0)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.spines["bottom"].set_color(GRID)
    axes.grid(axis="y", color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    handles = [axes.bar(0, 0, color=_BAR[split]) for split in scores["ir"]]
    axes.plot([], [], color=INK, lw=1.6, label="noise floor")
    line = axes.get_lines()[0]
    axes.legend([*handles, line], [*scores["ir"], "noise floor"], loc="upper center", bbox_to_anchor=(0.5, 1.2), ncol=3,
                frameon=False, fontsize=9, labelcolor=INK)  # fmt: skip
