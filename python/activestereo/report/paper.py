# SPDX-License-Identifier: Apache-2.0
"""Writes outputs for papers: figures with axes, units and colour bars as one PDF, and results as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from activestereo.common.output_files import replace_file, write_text
from activestereo.common.palette import INK, MUTED
from activestereo.diagnose.words import alike, headline
from activestereo.report.charts import covariates_chart, effects_chart, frames_chart, photon_transfer_chart
from activestereo.report.lettering import escape_dollars, save_figure
from activestereo.report.models import known_residual, residual_limit, worst_frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from activestereo.capture.capture import ImageKey
    from activestereo.compare.compare import Comparison

_SIDE = "left"


def write_comparison_pdf(path: str | Path, comparison: Comparison) -> None:
    """Writes the figures of a comparison as one PDF."""
    images = {"simulated": comparison.predictions}
    _write_pdf(path, [_images_figure(comparison, images, comparison.scores["capture"]), *_charts(comparison.scores)])


def write_diagnosis_pdf(
    path: str | Path, comparison: Comparison, result: Mapping[str, Any], found: Mapping[ImageKey, NDArray[np.float32]],
) -> None:  # fmt: skip
    """Writes the figures of a diagnosis as one PDF. comparison: the comparison of its start model; found: the images
    that model.json expects."""
    images = {"model": comparison.predictions}
    if result["added"]:
        images["model with what was found"] = dict(found)
    figures = [_images_figure(comparison, images, headline(result))]
    steps = [step for step in result["curve"] if step["heldout_ir_rmse"] is not None]
    if steps:
        figures.append(effects_chart(steps, result["heldout_noise_floor"]))
    _write_pdf(path, [*figures, *_charts(comparison.scores)])


def write_comparison_csv(path: str | Path, scores: Mapping[str, Any]) -> None:
    """Writes a CSV row of errors for each frame and camera. An empty cell is an unknown value. scores: compare.json's
    contents."""
    names = ("rmse_dn", "bias_dn", "render_noise_dn", "noise_floor_dn", "explainable_rmse_dn")
    rows = [
        [frame["id"], frame["split"], side, *(values[name] for name in names)]
        for frame in scores["frames"]
        for side, values in frame["cameras"].items()
    ]
    _write_csv(path, ["frame", "split", "camera", *names], rows)


def write_diagnosis_csv(path: str | Path, result: Mapping[str, Any]) -> None:
    """Writes a CSV row for each parameter of each ranked effect, one row for an effect without parameters. result:
    diagnose.json's contents."""
    rows = []
    for place, entry in enumerate(result["ranking"], 1):
        added, others = int(entry["effect"] in result["added"]), " ".join(alike(result, entry))
        figures = [entry[name] for name in ("score_nats", "explained_share", "confidence")]
        shared = [place, entry["effect"], entry["family"], *figures, added, others]
        for name, p in entry["parameters"].items():
            value = " ".join(p["materials"]) if "materials" in p else p["value"]
            rows.append([*shared, name, value, p["low"], p["high"], p["unit"]])
        if not entry["parameters"]:
            rows.append([*shared, *[""] * 5])
    head = ["place", "effect", "family", "gain_nats", "explained_share", "confidence", "added", "cannot_be_told_from",
            "parameter", "value", "low_90", "high_90", "unit"]  # fmt: skip
    _write_csv(path, head, rows)


def _write_csv(path: str | Path, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    write_text(path, file.getvalue())


def _write_pdf(path: str | Path, figures: Sequence[Figure]) -> None:
    content = io.BytesIO()
    with PdfPages(content, metadata={"CreationDate": None}) as pages:
        for figure in figures:
            save_figure(figure, pages, format="pdf", bbox_inches="tight")
    replace_file(path, lambda file: file.write(content.getvalue()))


def _charts(scores: Mapping[str, Any]) -> list[Figure]:
    """Returns charts of errors per frame, photon transfer, and residuals against the covariates with findings."""
    figures = [frames_chart(scores)]
    if scores["photon_transfer"] and scores["noise_model"]:
        figures.append(photon_transfer_chart(scores["photon_transfer"], scores["noise_model"]))
    for channel in scores["regions"]:
        findings = [t for t in scores["where"] if t["channel"] == channel and t["is_finding"]]
        if findings:
            unit = "share of pixels" if findings[0]["unit"] in ("", "1") else findings[0]["unit"]
            figures.append(covariates_chart(findings, f"{channel} residual, {unit}"))
    return figures


def _images_figure(comparison: Comparison, images: Mapping[str, Mapping[ImageKey, NDArray]], title: str) -> Figure:
    """Draws the worst frame's left image, each model's expected image and its residual, with axes in pixels. images:
    {model: {(frame id, side): DN}}."""
    scores = comparison.scores
    entry = worst_frame(scores, "test" if "test" in scores["ir"] else "train")
    key = entry["id"], _SIDE
    measured = comparison.measured[key].astype(np.float64)
    high = max(float(np.quantile(measured, 0.998)), 1.0)
    rest = {name: known_residual(comparison.capture, key, comparison.measured, own) for name, own in images.items()}
    limit = max(residual_limit(residual, entry["noise_floor_dn"]) for residual in rest.values())
    gray = {"cmap": "gray", "vmin": 0.0, "vmax": high}
    signed = {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit}
    columns = 1 + len(images)
    figure = Figure(figsize=(4.4 * columns, 5.6), layout="constrained")
    figure.suptitle(f"{escape_dollars(title)} (frame {entry['id']}, {_SIDE} camera)", size=11, color=INK)
    panels = [(1, "measured", measured, gray)]
    for column, (name, own) in enumerate(images.items(), 2):
        panels.append((column, name, own[key], gray))
        panels.append((columns + column, f"measured − {name}", rest[name], signed))
    for place, name, image, style in panels:
        axes = figure.add_subplot(2, columns, place)
        shown = axes.imshow(image, interpolation="nearest", **style)
        axes.set_title(name, size=10, color=INK, loc="left")
        axes.set_xlabel("u, px", size=8.5, color=MUTED)
        axes.set_ylabel("v, px", size=8.5, color=MUTED)
        axes.tick_params(labelsize=8, colors=MUTED)
        figure.colorbar(shown, ax=axes, shrink=0.8, extend="max" if style is gray else "both").set_label("DN", size=8.5)
    return figure
