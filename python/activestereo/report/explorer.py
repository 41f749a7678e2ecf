# SPDX-License-Identifier: Apache-2.0
"""Writes the report's explorer as HTML. Its data for web/explorer.js are the images of each frame and camera, as
measured and as each model expects them."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps

from activestereo.capture.capture import SIDES, SPLITS
from activestereo.common.html_table import text
from activestereo.common.lens import disparity_of
from activestereo.report.models import (
    BASE,
    FOUND,
    ModelImages,
    ToldErrors,
    known_residual,
    residual_limit,
    rmse,
)
from activestereo.report.page import encoded_image, web_file

if TYPE_CHECKING:
    from activestereo.capture.capture import Frame
    from activestereo.compare.compare import Comparison
    from activestereo.compare.depth_compare import DepthFrame

# Quantisation step of stored model images, as a share of a frame's noise floor, or of its error without a floor.
_STEP_SHARE = 0.125
_DISPARITY_STEP_PX = 1.0 / 64.0
_LEAST_DISPARITY_LIMIT_PX, _DISPARITY_FLOORS = 0.5, 4.0
_ROW_STEP_SHARE = 0.25  # coarser for ranked effects, which are only compared with one another
# Limits of the page's size in infrared pixels of both cameras, about 3 bytes each. The second limit is for frames
# that also show a dozen ranked effects, 4 bytes more per pixel.
_LARGEST_PIXELS, _LARGEST_PIXELS_OF_ROWS = 1_600_000, 500_000
_COLOURS = 33
_DEPTH = "depth"


def explorer_section(comparison: Comparison, images: ModelImages, told: ToldErrors) -> str:
    """Returns the explorer's HTML with its data as a JSON script. images: {model: {(frame id, side): expected DN}} from
    model_images(); told: each model's RMSE from told_errors()."""
    data = explorer_data(comparison, images, told)
    held, every = len({view["frame"] for view in data["views"]}), len(comparison.capture.frames)
    note = f"The page holds {held} of {every} frames, those furthest from the model first. " if held < every else ""
    markup = web_file("explorer.html").replace("$note", text(note))
    # A "<" would end the script element early.
    content = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'{markup}<script type="application/json" id="explorer-data">{content}</script>'


def explorer_data(comparison: Comparison, images: ModelImages, told: ToldErrors) -> dict[str, Any]:
    """Returns {views, start, models, rows, maps} for web/explorer.js. Views are in the order of frames, then left,
    right, depth. start: the frame shown first. rows: ids of frames with images of ranked effects."""
    frames = _chosen_frames(comparison, _LARGEST_PIXELS)
    with_rows = [frame for frame in _chosen_frames(comparison, _LARGEST_PIXELS_OF_ROWS) if frame in frames]
    large = {name: own for name, own in images.items() if name in (BASE, FOUND)}
    depths = {depth.frame.id: depth for depth in comparison.depths}
    views = []
    for frame in frames:
        held = images if frame in with_rows else large
        views += [_infrared_view(comparison, frame, side, images, held, told) for side in SIDES]
        if frame.id in depths:
            views.append(_depth_view(depths[frame.id], comparison))
    ranked = [name for name in images if name not in (BASE, FOUND)]
    words = {BASE: "base model", FOUND: "model with what was found"} | {
        name: f"base model with {name} alone" for name in ranked
    }
    split = "test" if "test" in comparison.scores["ir"] else "train"
    entries = [e for e in comparison.scores["frames"] if e["split"] == split]
    # The error beyond the noise floor; the whole error where the floor is unknown.
    beyond = lambda e: (e["rmse_dn"] if e["explainable_rmse_dn"] is None else e["explainable_rmse_dn"]) or 0.0  # noqa: E731
    return {
        "views": views,
        "start": max(entries, key=beyond)["id"],
        "models": {name: words[name] for name in images},
        "rows": [frame.id for frame in with_rows],
        "maps": colour_maps(),
    }


def _chosen_frames(comparison: Comparison, most_pixels: int) -> list[Frame]:
    """Returns the frames whose images the page holds, in the capture's order. If the images of all frames have more
    than most_pixels, it takes the worst frames of each split in turn, two at least."""
    frames = {frame.id: frame for frame in comparison.capture.frames}
    rig = comparison.capture.rig
    fit = max(2, most_pixels // sum(rig.camera(side).width * rig.camera(side).height for side in SIDES))
    if len(frames) <= fit:
        return list(frames.values())
    of = {split: [e for e in comparison.scores["frames"] if e["split"] == split] for split in SPLITS}
    for entries in of.values():
        entries.sort(key=lambda e: -(e["explainable_rmse_dn"] or e["rmse_dn"]))
    order = [e["id"] for rank in range(len(frames)) for entries in of.values() for e in entries[rank : rank + 1]]
    chosen = set(order[:fit])
    return [frame for frame in comparison.capture.frames if frame.id in chosen]


def _infrared_view(
    comparison: Comparison, frame: Frame, side: str, images: ModelImages, held: ModelImages, told: ToldErrors
) -> dict[str, Any]:
    """Returns the data of one infrared image for web/explorer.js: encoded images, scales and RMSE. images: of all
    models, for the RMSE. held: of the models that the page shows."""
    scores = next(e for e in comparison.scores["frames"] if e["id"] == frame.id)["cameras"][side]
    capture, key, floor = comparison.capture, (frame.id, side), scores["noise_floor_dn"]
    measured, base = capture.ir(frame, side), images[BASE][key].astype(np.float64)
    typical = floor or scores["rmse_dn"] or 1.0
    rest = {name: known_residual(comparison, key, own) for name, own in images.items()}
    layers = {"measured": encoded_image(measured, 1.0, capture.known(frame, side))}
    layers[BASE] = encoded_image(base, _STEP_SHARE * typical)
    for name in held:
        if name != BASE:  # stored as a difference from BASE, mostly zeros, which compresses well
            change = images[name][key] - base
            share = _STEP_SHARE if name == FOUND else _ROW_STEP_SHARE
            layers[name] = encoded_image(change, share * typical) | {"added_to": BASE}
    return {
        "frame": frame.id, "split": frame.split, "camera": side, "unit": "DN", "digits": 1, "map": "gray", "power": 0.5,
        "width": measured.shape[1], "height": measured.shape[0],
        "range": [0.0, max(float(np.quantile(measured, 0.998)), 1.0)],
        "limit": residual_limit(rest[BASE], floor), "floor": floor, "layers": layers,
        "rmse": {name: told[name][key] if name in told else rmse(own) for name, own in rest.items()},
    }  # fmt: skip


def _depth_view(depth: DepthFrame, comparison: Comparison) -> dict[str, Any]:
    """Returns the explorer's data of one depth frame: disparities of the device and of the compared model, pixels."""
    disparity = [disparity_of(z, depth.focal_baseline) for z in (depth.measured, depth.model[0])]
    name = FOUND if comparison.model.effects else BASE
    error, valid = depth.disparity_error(depth.measured, depth.model[0])
    scores = comparison.scores["depth"][depth.frame.split]
    seen = disparity[0][disparity[0] > 0]
    low, high = (float(q) for q in np.quantile(seen, (0.01, 0.99))) if seen.size else (0.0, 1.0)
    named = zip(("measured", name), disparity, strict=True)
    layers = {key: encoded_image(d, _DISPARITY_STEP_PX) for key, d in named}
    return {
        "frame": depth.frame.id, "split": depth.frame.split, "camera": _DEPTH, "unit": "px", "digits": 2,
        "map": "viridis", "power": 1.0,
        "width": disparity[0].shape[1], "height": disparity[0].shape[0], "range": [low, max(high, low + 1e-3)],
        "limit": max(_LEAST_DISPARITY_LIMIT_PX, _DISPARITY_FLOORS * (scores["noise_floor_median_abs_px"] or 0.0)),
        "floor": scores["noise_floor_px"], "layers": layers,
        "rmse": {name: float(np.sqrt(np.mean(error[valid] ** 2))) if valid.any() else None},
    }  # fmt: skip


def colour_maps() -> dict[str, list[list[int]]]:
    """Returns the stops, RGB 0..255, of each colour map that the pages draw with."""
    stops = np.linspace(0.0, 1.0, _COLOURS)
    rgb = {name: colormaps[name](stops)[:, :3] for name in ("gray", "RdBu_r", "viridis")}
    return {name: np.rint(255.0 * own).astype(int).tolist() for name, own in rgb.items()}
