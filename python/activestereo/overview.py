"""The pictures that put a result on one page. Figures are made without pyplot, so nothing global is touched."""

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from activestereo.output_files import replace_file

_INK, _MUTED, _GRID = "#1f2933", "#7b8794", "#e4e7eb"
_BLUE, _ORANGE = "#3e6fb0", "#c8722c"
_NO_DATA = "#15181c"
_ERROR_SCALE_M = 0.02


def write_figure(path, figure):
    replace_file(path, lambda file: figure.savefig(file, format="png", dpi=110))


def simulation_figure(title, rgb, ir, depth, true_depth, rows):
    """A sensor's frame: pictures on top, depth against truth below them, and the figures of each material at the bottom.

    rgb: float [h, w, 3] 0..1. ir: the measured pair, uint8. depth, true_depth: metres, 0 = none. rows: from accuracy_by_material.
    """
    figure = Figure(figsize=(17.0, 13.2), facecolor="white")
    grid = figure.add_gridspec(3, 3, height_ratios=[3.1, 3.1, 2.6], left=0.05, right=0.975, top=0.915, bottom=0.055, wspace=0.07, hspace=0.17)
    figure.text(0.05, 0.965, title, fontsize=19, weight="bold", color=_INK, va="center")
    figure.text(0.05, 0.940, _headline(rows), fontsize=12.5, color=_MUTED, va="center")
    _picture(figure.add_subplot(grid[0, 0]), rgb, "RGB camera")
    _picture(figure.add_subplot(grid[0, 1]), ir[0], "infrared left, as measured", cmap="gray", vmin=0, vmax=255)
    _picture(figure.add_subplot(grid[0, 2]), ir[1], "infrared right, as measured", cmap="gray", vmin=0, vmax=255)
    span = depth_span(true_depth)
    _depth(figure.add_subplot(grid[1, 0]), depth, "measured depth, registered to RGB", span)
    _depth(figure.add_subplot(grid[1, 1]), true_depth, "true depth", span)
    _error(figure.add_subplot(grid[1, 2]), depth, true_depth)
    charts = grid[2, :].subgridspec(1, 2, wspace=0.16)
    _bars(figure.add_subplot(charts[0]), rows, [100.0 * r.fill for r in rows], "measured pixels", "%", _BLUE)
    _bars(figure.add_subplot(charts[1]), rows, [1e3 * r.median_error_m for r in rows], "median error", "mm", _ORANGE)
    return figure


def matching_figure(title, left, right, disparity, depth):
    """An infrared pair and what the engine made of it. disparity: pixels, -1 = none; depth: metres, 0 = none."""
    figure = Figure(figsize=(14.0, 9.2), facecolor="white")
    grid = figure.add_gridspec(2, 2, left=0.03, right=0.95, top=0.88, bottom=0.03, wspace=0.12, hspace=0.12)
    figure.text(0.03, 0.955, title, fontsize=17, weight="bold", color=_INK, va="center")
    fill = 100.0 * np.mean(depth > 0)
    figure.text(0.03, 0.922, f"{fill:.1f} % of the pixels measured", fontsize=12, color=_MUTED, va="center")
    _picture(figure.add_subplot(grid[0, 0]), left, "left", cmap="gray")
    _picture(figure.add_subplot(grid[0, 1]), right, "right", cmap="gray")
    shown = np.where(disparity > 0, disparity, 0.0)
    _depth(figure.add_subplot(grid[1, 0]), shown, "disparity", depth_span(shown), unit="px", cmap="turbo")
    _depth(figure.add_subplot(grid[1, 1]), depth, "depth", depth_span(depth))
    return figure


def depth_span(depth):
    """(near, far) that leaves out the farthest and nearest percent, so that one stray pixel does not take all the colours."""
    valid = depth[depth > 0]
    if not valid.size:
        return 0.0, 1.0
    near, far = np.percentile(valid, (1.0, 99.0))
    return float(near), float(max(far, near + 1e-3))


def colored(values, span, cmap):
    """uint8 [h, w, 3] of positive values; dark where there is none."""
    from matplotlib import colormaps

    rgba = colormaps[cmap](Normalize(*span, clip=True)(values))[..., :3]
    rgba[~(values > 0)] = [int(_NO_DATA[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    return np.rint(255.0 * rgba).astype(np.uint8)


def _headline(rows):
    total = rows[-1]
    return (
        f"{100.0 * total.fill:.1f} % of the pixels measured, median error {1e3 * total.median_error_m:.1f} mm, "
        f"nine in ten within {1e3 * total.p90_error_m:.1f} mm"
    )


def _picture(axes, image, title, **style):
    shown = axes.imshow(image, interpolation="antialiased", **style)
    axes.set_title(title, fontsize=12.5, color=_INK, loc="left", pad=6)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
    return shown


def _color_bar(axes, shown, label, **style):
    inset = axes.inset_axes([1.012, 0.0, 0.018, 1.0])
    bar = axes.figure.colorbar(shown, cax=inset, **style)
    bar.outline.set_visible(False)
    inset.tick_params(labelsize=9.5, color=_MUTED, labelcolor=_INK, length=2)
    inset.set_title(label, fontsize=9.5, color=_INK, pad=5)


def _depth(axes, depth, title, span, unit="m", cmap="viridis_r"):
    shown = _picture(axes, np.ma.masked_where(depth <= 0, depth), title, cmap=cmap, vmin=span[0], vmax=span[1])
    axes.set_facecolor(_NO_DATA)
    _color_bar(axes, shown, unit)


def _error(axes, depth, true_depth):
    both = (depth > 0) & (true_depth > 0)
    error = np.ma.masked_where(~both, 1e3 * (depth - true_depth))
    limit = 1e3 * _ERROR_SCALE_M
    shown = _picture(axes, error, "measured minus true depth (black: no measurement)", cmap="RdBu_r", vmin=-limit, vmax=limit)
    axes.set_facecolor(_NO_DATA)
    _color_bar(axes, shown, "mm", extend="both")


def _bars(axes, rows, values, title, unit, color):
    places = np.arange(len(rows))
    axes.barh(places, np.nan_to_num(values), height=0.66, color=[color] * (len(rows) - 1) + [_INK])
    most = max([v for v in values if np.isfinite(v)], default=1.0)
    for place, value in zip(places, values, strict=True):
        text = f"{value:.1f} {unit}" if np.isfinite(value) else "no measurement"
        axes.text(max(np.nan_to_num(value), 0.0) + 0.008 * most, place, text, va="center", fontsize=10.5, color=_INK)
    axes.set_yticks(places, [row.name for row in rows], fontsize=11, color=_INK)
    axes.set_xlim(0, 1.13 * most)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_title(f"{title} by material", fontsize=12.5, color=_INK, loc="left", pad=6)
    axes.tick_params(axis="x", labelsize=9.5, color=_GRID, labelcolor=_MUTED)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)
