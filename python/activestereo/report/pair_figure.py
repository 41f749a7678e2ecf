# SPDX-License-Identifier: Apache-2.0
"""Draws a real pair beside a simulated one: left images, differences between the cameras, and statistics of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from activestereo.common.palette import BLUE, ORANGE
from activestereo.compare.pair_findings import Finding, residual_image
from activestereo.report.lettering import escape_dollars

_COLOURS = (BLUE, ORANGE)
_DETAIL = 0.25  # share of the image's width that the detail shows, from its middle


def pair_figure(
    pairs: Mapping[str, tuple[NDArray, NDArray]],
    disparities: Mapping[str, NDArray],
    findings_of: Mapping[str, Sequence[Finding]],
) -> Figure:
    """Draws two infrared pairs in rows. pairs: {name: (left, right) DN [height][width]}; disparities: {name: px of the
    left image, 0 = none}; findings_of: {name: results of pair_statistics()}."""
    figure = Figure(figsize=(15, 10.5), layout="constrained")
    grid = figure.add_gridspec(3, 4, height_ratios=(1, 1, 0.9))
    highest = max(float(np.quantile(pair[0], 0.995)) for pair in pairs.values())
    for row, (name, (left, right)) in enumerate(pairs.items()):
        rest, _ = residual_image(left.astype(np.float64), right.astype(np.float64), disparities[name])
        axes = [figure.add_subplot(grid[row, column]) for column in range(4)]
        axes[0].imshow(left, cmap="gray", norm=PowerNorm(0.5, 0, highest))
        axes[0].set_title(f"{escape_dollars(name)}: left camera (display gamma 2)", fontsize=9)
        height, width = left.shape
        half = int(0.5 * _DETAIL * width), int(0.5 * _DETAIL * height)
        middle = np.s_[height // 2 - half[1] : height // 2 + half[1], width // 2 - half[0] : width // 2 + half[0]]
        axes[1].imshow(left[middle], cmap="gray", norm=PowerNorm(0.5, 0, highest))
        axes[1].set_title("its middle, four times as large", fontsize=9)
        axes[2].imshow(rest[middle], cmap="RdBu", vmin=-0.15 * highest, vmax=0.15 * highest)
        axes[2].set_title(f"left less right there, ±{0.15 * highest:.0f} DN", fontsize=9)
        axes[3].imshow(np.where(disparities[name] > 0, disparities[name], np.nan), cmap="viridis")
        axes[3].set_title("disparity (white: none)", fontsize=9)
        for each in axes:
            each.set_axis_off()
    counts = figure.add_subplot(grid[2, :2])
    for colour, (name, pair) in zip(_COLOURS, pairs.items(), strict=False):
        values = np.bincount(np.minimum(pair[0].ravel().astype(np.int64), 4095))
        counts.plot(np.arange(len(values)), values / pair[0].size, color=colour, label=name, lw=1.2)
    counts.set(yscale="log", xlim=(0, 1.1 * highest), xlabel="left image, DN", ylabel="share of the pixels")
    counts.legend(frameon=False)
    _table(figure.add_subplot(grid[2, 2:]), findings_of)
    return figure


def _table(axes: Axes, findings_of: Mapping[str, Sequence[Finding]]) -> None:
    axes.set_axis_off()
    names = {f.name: f for findings in findings_of.values() for f in findings}
    rows = []
    for shown in names.values():
        scale, unit = (100.0, "%") if shown.unit == "1" else (1.0, shown.unit)
        found = [next((f for f in findings if f.name == shown.name), None) for findings in findings_of.values()]
        rows.append([shown.text, *("-" if f is None else f"{scale * f.value:.3g} {unit}" for f in found)])
    table = axes.table(
        cellText=rows, colLabels=["", *findings_of], colWidths=[0.56, 0.22, 0.22], loc="center", cellLoc="left",
        edges="horizontal",
    )  # fmt: skip
    table.auto_set_font_size(False)
    table.set_fontsize(9)
    table.scale(1.0, 1.35)
