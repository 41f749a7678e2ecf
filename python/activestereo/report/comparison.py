# SPDX-License-Identifier: Apache-2.0
"""Writes the report's HTML sections on a comparison: depth, error, noise floor, and where the model fails."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from activestereo.common.html_table import table, text
from activestereo.compare.where import LARGEST_DISPARITY_ERROR_PX
from activestereo.report.charts import WORDS, covariates_chart, frames_chart, photon_transfer_chart
from activestereo.report.page import card, chart, section

if TYPE_CHECKING:
    from activestereo.compare.compare import Comparison

_CHANNEL = {"infrared": "Infrared", "disparity": "Disparity", "validity": "Validity"}
_MEANING = {
    "infrared": "Residual of both cameras: measured minus simulated.",
    "disparity": f"Device minus model where both measured; beyond {LARGEST_DISPARITY_ERROR_PX:g} px an error "
    "counts no more. The device's "
    "matcher is not known, so a part of this is the difference of two matchers.",
    "validity": "1 where the device alone measured, −1 where the model alone did.",
}
_CHARTS = 8


def cards(scores: dict[str, Any]) -> str:
    parts = []
    for split, values in scores["ir"].items():
        known = values["noise_floor_dn"]
        floor = "noise floor unknown" if known is None else f"noise floor {known:.2f} DN"
        above = "" if values["explainable_rmse_dn"] is None else f", explainable {values['explainable_rmse_dn']:.2f} DN"
        parts.append(card(f"infrared RMSE, {split}", f"{values['rmse_dn']:.2f} DN", floor + above))
    for split, values in scores["depth"].items():
        floor = f"noise floor {values['noise_floor_px']:.3f} px" if values["noise_floor_px"] is not None else ""
        metres = ""
        if values["rmse_m"] is not None:
            metres = f", {1e3 * values['rmse_m']:.1f} mm, bias {1e3 * values['bias_m']:+.1f} mm"
        parts.append(card(f"depth RMSE, {split}", _pixels(values["rmse_px"]), floor + metres))
        fill = f"{100 * values['fill_measured']:.1f} / {100 * values['fill_model']:.1f} %"
        parts.append(card(f"fill, device / model, {split}", fill, f"validity IoU {values['validity_iou']:.3f}"))
    return f'<div class="cards">{"".join(parts)}</div>'


def comparison_sections(comparison: Comparison) -> list[str]:
    """Returns the HTML of the sections on depth, on error and noise floor, and on where the model fails."""
    scores = comparison.scores
    parts = []
    if scores["depth"]:
        parts.append(section("Depth: device, model and geometry", _depth_table(scores["depth"])))
    parts.append(section("Error and noise floor", chart(frames_chart(scores), "error per frame"), _noise(scores)))
    parts.append(_where(scores))
    return parts


def settings_section(scores: dict[str, Any]) -> str:
    nuisances, errors = scores["fit"]["nuisances"], scores["fit"]["standard_errors"]
    rows = [[text(name.replace("_", " ")), f"{nuisances[name]:.6g}", f"± {errors[name]:.2g}"] for name in nuisances]
    quality = f"{scores['samples_per_pixel']} samples per pixel, {scores['max_bounces']} bounces"
    made = f"{scores['renderer']}; {quality}, seed {scores['seed']}."
    clipped = f"{100 * scores['fit']['clipped_fraction']:.2f} % of the pixels were clipped and left out."
    model = "".join(f'<span class="tag">{text(name)}</span>' for name in scores["effects"]) or "none: the base model"
    return section(
        "How this was made",
        f"<p>Effects in the model: {model}</p>",
        "<p>Fitted on the train frames:</p>",
        table(["nuisance", "value", "standard error"], rows, numbers=(1, 2)),
        f'<p class="muted small">{text(clipped)} {text(made)}</p>',
    )


def _pixels(value: float | None) -> str:
    return "—" if value is None else f"{value:.3f} px"


def _depth_table(depth: dict[str, Any]) -> str:
    """Returns an HTML table of disparity errors: device against model, and each against the known geometry."""
    rows = []
    for split, values in depth.items():
        pairs = [("device against model", values, values["noise_floor_px"])]
        names = {"measured": "device against geometry", "model": "model against geometry"}
        pairs += [(names[who], v, None) for who, v in values["truth"].items()]
        for name, error, floor in pairs:
            bias = "—" if error["bias_m"] is None else f"{1e3 * error['bias_m']:+.1f} mm"
            rmse_mm = "—" if error["rmse_m"] is None else f"{1e3 * error['rmse_m']:.1f} mm"
            in_px = map(_pixels, (error["rmse_px"], error["median_abs_px"], floor))
            rows.append([split, name, rmse_mm, bias, *in_px])
    source = {v["noise_floor_from"] for v in depth.values()}
    note = "two repeats of the device" if source == {"repeats"} else "two noisy exposures of the model, matched alike"
    head = ["", "", "RMSE", "bias", "RMSE, disparity", "median, disparity", "noise floor"]
    said = f"Noise floor: {note}. The pictures above show the depth images, too."
    return f'{table(head, rows, numbers=range(2, 7))}<p class="muted small">{said}</p>'


def _noise(scores: dict[str, Any]) -> str:
    if not scores["photon_transfer"]:
        return "<p>No frames are repeated: the noise floor and the photon transfer are unknown.</p>"
    noise = scores["noise_model"]
    terms = f"{noise['offset']:.3g} + {noise['shot']:.3g} · gain · s + {noise['relative']:.3g} · s²"
    words = f"variance = {terms}, s in DN above {noise['black_dn']:.3g}: read noise, shot noise and speckle, "
    words += "from frames repeated at one pose."
    picture = chart(photon_transfer_chart(scores["photon_transfer"], noise), "photon transfer")
    return f'<div style="max-width:560px">{picture}</div><p class="muted small">{text(words)}</p>'


def _where(scores: dict[str, Any]) -> str:
    parts = [
        '<p class="muted small">Train frames. Intervals are 95 %, by bootstrap of 16-pixel blocks; findings hold at a '
        "false discovery rate of 5 % (Benjamini-Yekutieli) and move at least 5 % of the explainable error.</p>"
    ]
    for channel, found in scores["channels"].items():
        tables = [t for t in scores["where"] if t["channel"] == channel]
        unit = tables[0]["unit"] if tables and tables[0]["unit"] != "1" else ""
        parts.append(f"<h3>{_CHANNEL[channel]}</h3><p class='muted small'>{text(_MEANING[channel])}</p>")
        unit_text = f" {unit}" if unit else ""
        size = f"RMSE {found['rmse']:.3g}{unit_text}, noise floor {found['noise_floor']:.3g}{unit_text}"
        if not found["is_explainable"]:
            parts.append(f"<p>{size}: at the floor, there is nothing to explain.</p>")
        else:
            parts.append(f"<p>{size}.</p>")
            shown = ([t for t in tables if t["is_finding"]] or tables)[:_CHARTS]
            parts.append(chart(covariates_chart(shown, unit), f"{channel} residual against covariates"))
        parts.append(_tables(tables))
    return section("Where it fails", *parts)


def _tables(tables: Sequence[dict[str, Any]]) -> str:
    parts = []
    for entry in tables:
        unit = f", {entry['covariate_unit']}" if entry["covariate_unit"] else ""
        mark = "finding" if entry["is_finding"] else "no finding"
        share = "" if entry["concentration"] is None else f", concentration {100 * entry['concentration']:.0f} %"
        rows = [
            [text(b["label"]) if "label" in b else f"{b['low']:.4g} … {b['high']:.4g}", f"{b['pixels']}",
             f"{b['mean']:+.3g}", "{:+.3g} … {:+.3g}".format(*b["mean_interval"]), f"{b['rmse']:.3g}",
             f"{b['noise_floor']:.3g}", f"{b['excess']:.3g}", "{:.3g} … {:.3g}".format(*b["excess_interval"])]
            for b in entry["bins"]
        ]  # fmt: skip
        figures = "pixels", "mean", "95 %", "RMSE", "noise floor", "squared excess", "95 %"
        head = [WORDS[entry["covariate"]] + unit, *figures]
        title = f"{WORDS[entry['covariate']]}: {mark}, q = {entry['q_value']:.2g}{share}"
        parts.append(f"<details><summary>{text(title)}</summary>{table(head, rows, numbers=range(1, 8))}</details>")
    return f"<details><summary>All {len(tables)} tables</summary>{''.join(parts)}</details>"
