# SPDX-License-Identifier: Apache-2.0
"""Evaluates all methods on all real views, with intervals from resampled views. Writes realism.json and
realism.html."""

from __future__ import annotations

import base64
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.real_views import (
    DISTANCE_NAMES,
    METHODS,
    depth_measures,
    infrared_measures,
    planar_patches,
    real_views,
    simulated,
)
from activestereo.benchmarks.sim_to_real import Figure
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import read_capture
from activestereo.common.html_table import table, text
from activestereo.common.output_files import png_bytes, write_json, write_text
from activestereo.common.progress_bar import Progress, silent

DEVICE = "device"
HOLES, NOISE = "hole IoU", "spatial noise: factor to the device's"
_DRAWS, _LEVEL = 4000, 0.9

Values = dict[str, list[dict[str, float]]]  # {method: for each view, {measure: value}}


@dataclass(frozen=True)
class Board:
    """The results of all methods. rows: {measure: {method: mean over views with its interval}}. pictures: {view:
    {method: disparity in pixels}}, for each capture's first view."""

    views: tuple[str, ...]
    rows: dict[str, dict[str, Figure]]
    pictures: dict[str, dict[str, NDArray[np.float32]]]


def board(
    captures: list[tuple[Path, Path | None]], sensor: str, samples: int, seed: int, device: str | int,
    progress: Progress = silent,
) -> Board:  # fmt: skip
    """Computes the Board of captures. captures: (folder, folder of the device's depth or None); None takes the
    capture's own depth. samples: samples per pixel of simulated images."""
    views: list[str] = []
    values: Values = {method: [] for method in (DEVICE, *METHODS)}
    pictures: dict[str, dict[str, NDArray[np.float32]]] = {}
    for number, (path, device_depth) in enumerate(captures):
        own = real_views(read_capture(path), device_depth, device)
        planes = [planar_patches(view.disparity(view.truth_m), view.focal_baseline_px_m) for view in own]
        shown: dict[str, NDArray[np.float32]] = {}
        # raster comes last, because it changes the scene's materials.
        for step, method in enumerate((DEVICE, *(m for m in METHODS if m != "raster"), "raster")):
            for view, patches in zip(own, planes, strict=True):
                made = None if method == DEVICE else simulated(view, method, sensor, samples, seed)
                black = view.capture.rig.black_dn
                if made is None:
                    level = float(np.percentile(view.left, 0.1)) if black is None else black[0]
                    found = depth_measures(view, view.device_m, None, patches)
                    found |= infrared_measures(view, view.left, view.right, patches, level)
                else:
                    found = depth_measures(view, *made.depth_m, patches)
                    if made.left is not None and made.right is not None:
                        level = StereoDepthSensorConfig(sensor).ir_black_level_dn
                        level = black[0] if method == "calibrated" and black is not None else level
                        found |= infrared_measures(view, made.left, made.right, patches, level)
                values[method].append(found)
                if view is own[0]:
                    shown[method] = view.disparity(view.device_m if made is None else made.depth_m[0])
            progress((number + (step + 1) / (len(METHODS) + 1)) / len(captures))
        pictures[own[0].name] = {"truth": own[0].disparity(own[0].truth_m), **shown}
        views += [view.name for view in own]
    return Board(tuple(views), _rows(values, seed), pictures)


def _rows(values: Values, seed: int) -> dict[str, dict[str, Figure]]:
    """Returns {measure: {method: Figure}}: means over views, with 90 % intervals by bootstrap over the views. values:
    {method: a {measure: value} for each view}."""
    count = len(values[DEVICE])
    chosen = np.random.default_rng(seed).integers(count, size=(_DRAWS, count))
    names = list(dict.fromkeys(name for own in values.values() for view in own for name in view))
    rows = {
        name: {
            method: _interval(np.array([view.get(name, np.nan) for view in own]), chosen)
            for method, own in values.items()
            if any(np.isfinite(view.get(name, np.nan)) for view in own)
        }
        for name in names
    }
    # Factor between a method's noise and the device's, whichever is larger, as a mean over the distances; 1 is equal.
    bins, rows[NOISE] = [f"spatial noise, px: {name}" for name in DISTANCE_NAMES], {}
    for method, own in values.items():
        pairs = zip(own, values[DEVICE], strict=True)
        off = [[abs(np.log(max(a[name], 1e-3) / b[name])) for name in bins] for a, b in pairs]
        with np.errstate(all="ignore"):
            factors = [np.exp(np.nanmean(one)) if np.isfinite(one).any() else np.nan for one in off]
        rows[NOISE][method] = _interval(np.array(factors), chosen)
    return {name: row for name, row in rows.items() if row}


def _interval(of_views: NDArray[np.float64], chosen: NDArray[np.int64]) -> Figure:
    if not np.isfinite(of_views).any():
        return Figure(*[float("nan")] * 3)
    drawn = of_views[chosen]
    sums, counts = np.nansum(drawn, axis=1), np.isfinite(drawn).sum(axis=1)
    means = sums[counts > 0] / counts[counts > 0]
    tail = 50.0 * (1.0 - _LEVEL)
    low, high = np.percentile(means, [tail, 100.0 - tail])
    return Figure(float(np.nanmean(of_views)), float(low), float(high))


def verdicts(found: Board) -> list[str]:
    """Returns sentences that name the method closest to the device in holes and in noise. They say whether its interval
    and the runner-up's overlap."""
    if len(found.views) < 2:
        return ["one view has no interval: who is closest is told from two on"]
    lines = []
    for name, is_more_better in ((HOLES, True), (NOISE, False)):
        row = {method: one for method, one in found.rows[name].items() if method != DEVICE}
        order = sorted(row, key=lambda method: -row[method].value if is_more_better else row[method].value)
        first, second = (row[method] for method in order[:2])
        apart = first.low > second.high if is_more_better else first.high < second.low
        overlap = "the intervals lie apart" if apart else "the intervals overlap"
        lines.append(f"{name}: {order[0]} is closest, {first}, before {order[1]}, {second}: {overlap}")
    return lines


_WIDTH_PX = 300
_STYLE = (  # six pictures abreast and all ten methods fit 1280 pixels
    "body{font:14px sans-serif;margin:1em 2em}h2{font-size:14px}table{font-size:12px}td,th{padding:2px 6px;text-align:"
    "right}td:first-child,th:first-child{text-align:left}small{display:block}figure{display:inline-block;margin:0 4px}"
    "img{width:190px}figcaption{font-size:12px}"
)


def write_board(found: Board, out: Path, about: dict[str, object]) -> None:
    """Writes realism.json and realism.html into the folder `out`. about: further contents of the JSON file."""
    rows = {name: {method: asdict(one) for method, one in row.items()} for name, row in found.rows.items()}
    lines = verdicts(found)
    content = about | {"views": list(found.views), "verdicts": lines, "measures": rows}
    write_json(out / "realism.json", content)
    methods = (DEVICE, *METHODS)
    cells = []
    for name, row in found.rows.items():
        own = (row.get(method) for method in methods)
        shown = ("–" if x is None else f"{x.value:.3g}<small>{x.low:.3g} to {x.high:.3g}</small>" for x in own)
        cells.append([text(name), *shown])
    parts = [f"<p>{text(line)}</p>" for line in lines]
    for view, pictures in found.pictures.items():
        low, high = np.nanpercentile(pictures["truth"], [1, 99])
        parts.append(f"<h2>{text(view)}: disparity, blue {low:.0f} to red {high:.0f} px, black none</h2>")
        parts += [_figure(name, image, float(low), float(high)) for name, image in pictures.items()]
    parts.append(table(["mean of views, 90 % below", *methods], cells))
    head = f"<h1>Realism of depth: {len(found.views)} real views of {text(about['sensor'])}</h1>"
    page = f"<!doctype html><meta charset=utf-8><title>Realism</title><style>{_STYLE}</style>{head}{''.join(parts)}"
    write_text(out / "realism.html", page + "\n")


def _figure(name: str, disparity: NDArray[np.float32], low: float, high: float) -> str:
    from matplotlib import colormaps

    step = max(1, disparity.shape[1] // _WIDTH_PX)
    image = disparity[::step, ::step]
    shade = colormaps["turbo"](np.clip((np.nan_to_num(image, nan=low) - low) / max(high - low, 1e-6), 0.0, 1.0))
    pixels = (255.0 * shade[..., :3] * np.isfinite(image)[..., None]).astype(np.uint8)
    source = base64.b64encode(png_bytes(pixels)).decode()
    return f'<figure><img src="data:image/png;base64,{source}"><figcaption>{text(name)}</figcaption></figure>'
