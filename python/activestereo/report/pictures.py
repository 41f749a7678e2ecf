# SPDX-License-Identifier: Apache-2.0
"""Draws results on one page: a simulated frame, a matched pair, or pictures side by side. Figures are made
without pyplot, so that no global state changes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from activestereo.common.accuracy import Accuracy
from activestereo.common.palette import BLUE, GRID, INK, MUTED, ORANGE
from activestereo.report.lettering import escape_dollars

_NO_DATA = "#15181c"
_LEAST_SPAN_MM = 5.0  # least range of the error's colour scale, which otherwise spans nine in ten pixels
_LONGEST_NAME = 17
_PANEL_IN, _TITLE_IN, _BAR_IN = 4.0, 0.35, 0.6


def simulation_figure(
    title: str, rgb: np.ndarray, ir: Sequence[np.ndarray], depth: np.ndarray, true_depth: np.ndarray,
    rows: Sequence[Accuracy],
) -> Figure:  # fmt: skip
    """Draws a simulated frame: RGB and infrared pictures above depth and true depth, and each material's figures at the
    bottom.

    rgb: float [h, w, 3] 0..1. ir: the measured pair, uint8. depth, true_depth: metres, 0 = none. rows: from
    accuracy_by_material().
    """
    aspect, chart_height = depth.shape[0] / depth.shape[1], 0.27 * len(rows) + 0.25
    page = _Page(title, _headline(rows), columns=3, aspect=aspect, chart_height=chart_height)
    _picture(page.picture(0, 0), rgb, "RGB camera")
    for column, (image, side) in enumerate(zip(ir, ("left", "right"), strict=True), start=1):
        name, shades = f"infrared {side}, as measured (display gamma 2)", PowerNorm(0.5, 0, 255)
        _picture(page.picture(0, column), image, name, cmap="gray", norm=shades)
    span = depth_span(true_depth)
    _depth(page.picture(1, 0), depth, "measured depth, registered to RGB (black: none)", span)
    _depth(page.picture(1, 1), true_depth, "true depth", span)
    _error(page.picture(1, 2), depth, true_depth)
    _bars(page.chart(0, 3), rows, [100.0 * r.fill for r in rows], "measured pixels", "%", BLUE)
    words = "invented: nothing is there, or 5 % off,"
    _bars(page.chart(2, 3), rows, [100.0 * r.invented for r in rows], words, "%", MUTED)
    _bars(page.chart(1, 3), rows, [1e3 * r.median_error_m for r in rows], "median error", "mm", ORANGE)
    return page.figure


def matching_figure(
    title: str, left: np.ndarray, right: np.ndarray, disparity: np.ndarray, depth: np.ndarray
) -> Figure:
    """Draws an infrared pair with its disparity and depth. disparity: pixels, -1 = none; depth: metres, 0 = none."""
    subtitle = f"{100.0 * np.mean(depth > 0):.1f} % of the pixels measured"
    page = _Page(title, subtitle, columns=2, aspect=depth.shape[0] / depth.shape[1])
    _picture(page.picture(0, 0), left, "left", cmap="gray")
    _picture(page.picture(0, 1), right, "right", cmap="gray")
    shown = np.where(disparity > 0, disparity, 0.0)
    _depth(page.picture(1, 0), shown, "disparity (black: none)", depth_span(shown), unit="px", cmap="turbo")
    _depth(page.picture(1, 1), depth, "depth (black: none)", depth_span(depth))
    return page.figure


class _Page:
    """Lays out a figure in inches: title, two rows of equal pictures with room for colour bars, and charts at the
    bottom."""

    WIDTH, MARGIN, BAR, HEAD, CAPTION = 5.2, 0.45, 0.72, 0.95, 0.42

    def __init__(self, title: str, subtitle: str, columns: int, aspect: float, chart_height: float = 0.0) -> None:
        self._picture_height = self.WIDTH * aspect
        self._chart_height = chart_height
        self._inner = columns * self.WIDTH + (columns - 1) * self.BAR
        below = chart_height + 0.95 if chart_height else 0.25
        height = self.HEAD + 2 * (self._picture_height + self.CAPTION) + below
        self._size = self._inner + 2 * self.MARGIN + 0.3, height
        self.figure = Figure(figsize=self._size, facecolor="white")
        left, title_at, subtitle_at = self.MARGIN / self._size[0], 1.0 - 0.42 / height, 1.0 - 0.76 / height
        self.figure.text(left, title_at, escape_dollars(title), va="center", fontsize=18, weight="bold", color=INK)
        self.figure.text(left, subtitle_at, subtitle, va="center", fontsize=12, color=MUTED)

    def _axes(self, left: float, bottom: float, width: float, height: float) -> Axes:
        w, h = self._size
        return self.figure.add_axes([left / w, bottom / h, width / w, height / h])

    def picture(self, row: int, column: int) -> Axes:
        top = self.HEAD + (row + 1) * (self._picture_height + self.CAPTION)
        left = self.MARGIN + column * (self.WIDTH + self.BAR)
        return self._axes(left, self._size[1] - top, self.WIDTH, self._picture_height)

    def chart(self, index: int, count: int) -> Axes:
        labels = 1.45
        width = self._inner / count
        return self._axes(self.MARGIN + index * width + labels, 0.4, width - labels - 0.35, self._chart_height)


def depth_span(depth: np.ndarray) -> tuple[float, float]:
    """Returns (near, far), the 1st and 99th percentiles of the values above 0, so that one stray pixel does not take
    all the colours."""
    valid = depth[depth > 0]
    if not valid.size:
        return 0.0, 1.0
    near, far = np.percentile(valid, (1.0, 99.0))
    return float(near), float(max(far, near + 1e-3))


def colored(values: np.ndarray, span: tuple[float, float], cmap: str) -> np.ndarray:
    """Colours positive values by a colour map, uint8 [h, w, 3]; other pixels are dark. span: the values at the map's
    ends."""
    rgba = colormaps[cmap](Normalize(*span, clip=True)(values))[..., :3]
    rgba[~(values > 0)] = [int(_NO_DATA[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    return np.rint(255.0 * rgba).astype(np.uint8)


def _headline(rows: Sequence[Accuracy]) -> str:
    total = rows[-1]
    if not total.pixels:
        return "nothing is in the sensor's range"
    if not total.fill:
        return "no pixel measured"
    return (
        f"{100.0 * total.fill:.1f} % of the pixels measured, median error {1e3 * total.median_error_m:.1f} mm, "
        f"nine in ten within {1e3 * total.p90_error_m:.1f} mm"
    )


def _picture(axes: Axes, image: np.ndarray, title: str, **style: Any) -> AxesImage:
    shown = axes.imshow(image, interpolation="antialiased", aspect="auto", **style)
    axes.set_title(title, fontsize=12.5, color=INK, loc="left", pad=6)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
    return shown


def _color_bar(axes: Axes, shown: AxesImage, label: str, **style: Any) -> None:
    inset = axes.inset_axes([1.012, 0.0, 0.018, 1.0])
    bar = axes.figure.colorbar(shown, cax=inset, **style)
    bar.outline.set_visible(False)
    inset.tick_params(labelsize=9.5, color=MUTED, labelcolor=INK, length=2)
    inset.set_title(label, fontsize=9.5, color=INK, pad=5)


def _depth(
    axes: Axes, depth: np.ndarray, title: str, span: tuple[float, float], unit: str = "m", cmap: str = "viridis_r"
) -> None:
    shown = _picture(axes, np.ma.masked_where(depth <= 0, depth), title, cmap=cmap, vmin=span[0], vmax=span[1])
    axes.set_facecolor(_NO_DATA)
    _color_bar(axes, shown, unit)


def _error(axes: Axes, depth: np.ndarray, true_depth: np.ndarray) -> None:
    both = (depth > 0) & (true_depth > 0)
    error = np.ma.masked_where(~both, 1e3 * (depth - true_depth))
    limit = max(_LEAST_SPAN_MM, float(np.quantile(np.abs(error.compressed()), 0.9)) if both.any() else 0.0)
    shown = _picture(axes, error, "measured minus true depth", cmap="RdBu_r", vmin=-limit, vmax=limit)
    axes.set_facecolor(_NO_DATA)
    _color_bar(axes, shown, "mm", extend="both")


def _bars(axes: Axes, rows: Sequence[Accuracy], values: Sequence[float], title: str, unit: str, color: str) -> None:
    places = np.arange(len(rows))
    axes.barh(places, np.nan_to_num(values), height=0.66, color=[color] * (len(rows) - 1) + [INK])
    most = max([v for v in values if np.isfinite(v)], default=0.0) or 1.0
    for place, value in zip(places, values, strict=True):
        text = f"{value:.1f} {unit}" if np.isfinite(value) else "none"
        axes.text(max(np.nan_to_num(value), 0.0) + 0.008 * most, place, text, va="center", fontsize=10.5, color=INK)
    names = [escape_dollars(row.name) for row in rows]
    short = [name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…" for name in names]
    axes.set_yticks(places, short, fontsize=11, color=INK)
    axes.set_xlim(0, 1.2 * most)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_title(f"{title} by material", fontsize=12.5, color=INK, loc="left", pad=6)
    axes.tick_params(axis="x", labelsize=9.5, color=GRID, labelcolor=MUTED)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)


def labelled_figure(pictures: Sequence[tuple[str, NDArray, tuple[float, float] | None]], columns: int) -> Figure:
    """Draws pictures, (title, image, ends of the colour scale), with their titles in rows of `columns`. image: RGB
    [height][width][3] or grey [height][width] in 0..1, without ends (None); or depth [height][width] in metres, which
    is coloured, and black where it is missing (0)."""
    rows = -(-len(pictures) // columns)
    aspect = pictures[0][1].shape[0] / pictures[0][1].shape[1]
    has_depth = any(near_far is not None for *_, near_far in pictures)
    size = columns * _PANEL_IN + has_depth * _BAR_IN, rows * (_PANEL_IN * aspect + _TITLE_IN)
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    colours = colormaps["viridis_r"].with_extremes(bad="black")
    places = figure.subplots(rows, columns, squeeze=False).ravel()
    for place, (name, image, near_far) in zip(places, pictures, strict=False):
        if near_far is None:
            place.imshow(np.clip(image, 0.0, 1.0), cmap="gray", vmin=0.0, vmax=1.0)
        else:
            known, (near, far) = np.ma.masked_equal(image, 0.0), near_far
            shown = place.imshow(known, cmap=colours, vmin=near, vmax=far, interpolation="nearest")
            bar = figure.colorbar(shown, ax=place, extend="both", fraction=0.04, pad=0.02)
            bar.set_label("m (black: none)", size=8, color=MUTED)
            bar.ax.tick_params(labelsize=8, colors=MUTED)
        place.set_title(name, size=10, color=INK, loc="left")
        place.set_axis_off()
    return figure
