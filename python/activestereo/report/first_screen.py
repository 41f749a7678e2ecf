# SPDX-License-Identifier: Apache-2.0
"""Writes the report's first screen as HTML: verdict, measured and modelled pictures, error against added effects, and
next steps. It fits a window of 1280 x 720 pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import SIDES, Frame
from activestereo.common.html_table import text
from activestereo.common.shown import two_digits
from activestereo.diagnose.words import (
    error_text,
    errors_of,
    errors_told,
    geometry_words,
    headline,
    next_steps,
    rival_words,
)
from activestereo.report.charts import covariates_chart, effects_chart, falloff_chart
from activestereo.report.models import BASE, FOUND, ModelImages, ToldErrors, known_residual, residual_limit, rmse
from activestereo.report.page import chart, coloured, data_address
from activestereo.report.screen import Step
from activestereo.report.summary import error_places

if TYPE_CHECKING:
    from activestereo.compare.compare import Comparison
    from activestereo.diagnose.room.unseen import Unseen

# A detail's share of the image's width and height, and the least width in pixels, which small images need.
_DETAIL, _LEAST_PX = 1.0 / 3.0, 140
_MOST_CELLS = 6  # two rows of pictures and charts
_MODELS = {BASE: "model", FOUND: "model with what was found"}
_RESIDUALS = {BASE: "measured − model", FOUND: "what is left"}


def first_screen(
    diagnosis: Mapping[str, Any], comparison: Comparison | None = None, images: ModelImages | None = None,
    steps: Sequence[Step] = (), told: ToldErrors | None = None, unseen: tuple[Unseen, Unseen] | None = None,
) -> str:  # fmt: skip
    """Returns the first screen of a diagnosis as HTML. diagnosis: diagnose.json's contents.

    images: expected DN of the models BASE and, if an effect was found, FOUND. steps: commands to paste. told: each
    model's RMSE from told_errors(). unseen: views of a measured room, as in Diagnosis, for its pictures. The screen has
    no pictures if there are neither `unseen` nor both comparison and images.
    """
    parts = [f"<h1>{text(headline(diagnosis))}</h1>", f'<p class="muted">{_errors(diagnosis)}</p>']
    parts += [f"<p>Warning: {text(warning)}.</p>" for warning in diagnosis.get("warnings", [])]
    cells = [] if comparison is None or images is None else _pictures(comparison, images, told or {})
    if unseen is not None:
        cells = _view_pictures(*unseen)
    floor = diagnosis["heldout_noise_floor"]
    fall = [step for step in diagnosis.get("curve", []) if step["heldout_ir_rmse"] is not None]
    if fall:
        curve = chart(effects_chart(fall, floor), "error against effects added")
        cells.insert(min(3, len(cells)), f'<div class="curve">{curve}</div>')
    parts.append(f'<div class="evidence">{"".join(cells)}</div>')
    advice = "".join(f"<li>{text(step)}</li>" for step in next_steps(diagnosis, all_open=True))
    parts.append(f"<h2>What to do next</h2><ul>{advice}</ul>{_pasted(steps)}" if advice or steps else "")
    return f'<section id="verdict" aria-label="Verdict">{"".join(parts)}</section>'


def comparison_first_screen(
    comparison: Comparison, images: ModelImages, sentences: Sequence[str], steps: Sequence[Step], told: ToldErrors
) -> str:
    """Returns the first screen of a comparison without a diagnosis as HTML. sentences: the headline first; steps:
    commands to paste; others as in first_screen()."""
    said = "".join(f"<p>{text(sentence)}</p>" for sentence in sentences[1:])
    advice = f"<h2>What to do next</h2>{_pasted(steps)}" if steps else ""
    cells = _pictures(comparison, images, told)
    for place in error_places(comparison.scores["where"])[: _MOST_CELLS - len(cells)]:
        drawn = chart(covariates_chart([place["table"]], "DN"), f"the error against {place['covariate']}")
        cells.append(f'<div class="curve">{drawn}</div>')
    pictures = f'<div class="evidence">{"".join(cells)}</div>'
    head = f"<h1>{text(sentences[0])}</h1>"
    return f'<section id="verdict" aria-label="Verdict">{head}{said}{pictures}{advice}</section>'


def _pasted(steps: Sequence[Step]) -> str:
    return "".join(f"<p>{text(step.label)}: <code>{text(step.text)}</code></p>" for step in steps)


def _errors(diagnosis: Mapping[str, Any]) -> str:
    """Returns an HTML paragraph: held-out errors, the verdict's reason, and the effects that cannot be told apart."""
    told, floor = errors_told(diagnosis), diagnosis["heldout_noise_floor"]
    said = [text(diagnosis["capture"]) + ". "] if diagnosis.get("capture") else []
    if told:
        noise = [] if floor is None else [f"sensor noise {floor:.2f} DN"]
        words = ", ".join([f"{name} {error_text(error, floor, 2)}" for name, error in told] + noise)
        said.append(f"{errors_of(diagnosis)}: {words}. ")
    why = diagnosis.get("reason")
    sentences = [f"{why[0].upper()}{why[1:]}."] if why and diagnosis["verdict"] != "undetermined" else []
    sentences += [*rival_words(diagnosis), *geometry_words(diagnosis)]
    return "".join([*said, *(f"{text(sentence)} " for sentence in sentences)])


@dataclass(frozen=True)
class Detail:
    """The window of one infrared image that the first screen shows enlarged. rows, columns: its pixels."""

    frame: Frame
    side: str
    rows: slice
    columns: slice


def _pictures(comparison: Comparison, images: ModelImages, told: ToldErrors) -> list[str]:
    """Returns HTML with pictures of one infrared image. First comes the Detail, as measured and as each model expects
    it; then, for each model, measured minus expected of the whole image."""
    detail = where_most_goes(comparison, images)
    key, part = (detail.frame.id, detail.side), (detail.rows, detail.columns)
    measured = comparison.measured[key]
    high = max(float(np.quantile(measured, 0.998)), 1.0)
    place = f"frame {detail.frame.id}, {detail.side} camera, detail"
    models = [name for name in (BASE, FOUND) if name in images]
    entry = next(e for e in comparison.scores["frames"] if e["id"] == key[0])["cameras"][key[1]]
    floor = float(entry["noise_floor_dn"] or entry["rmse_dn"] or 1.0)
    cells = [_cell(_gray(measured[part], high), "measured", place)]
    cells += [_cell(_gray(images[name][key][part], high), _MODELS[name], "") for name in models]
    residuals = {name: known_residual(comparison, key, images[name]) for name in models}
    limit = residual_limit(residuals[BASE], floor)
    if FOUND not in images:
        cells.append(_cell(_signed(residuals[BASE][part], limit), "measured − model, there", ""))
    for name, rest in residuals.items():
        grey = ", grey: not compared" if np.isnan(rest).any() else ""
        error = told[name][key] if name in told else rmse(rest)
        note = f"{error:.2f} DN here, colours ±{two_digits(limit)} DN{grey}"
        cells.append(_cell(_signed(rest, limit), _RESIDUALS[name], note))
    return cells


def _view_pictures(before: Unseen, after: Unseen) -> list[str]:
    """Returns HTML with pictures of one view of a measured room, in the order of _pictures(). If an effect was found, a
    chart shows the error towards the corners. before, after: the view as predicted without and with what was found."""
    views = {BASE: before} | ({FOUND: after} if after is not before else {})
    measured, residuals = before.measured, {name: view.measured - view.expected for name, view in views.items()}
    high, limit = max(float(np.quantile(measured, 0.998)), 1.0), residual_limit(residuals[BASE], None)
    notes = {BASE: "by the other views, grey: not seen", FOUND: ""}
    cells = [_cell(_gray(measured, high), "measured", f"view {before.frame}, left camera, white {high:.0f} DN")]
    cells += [_cell(_gray(view.expected, high), _MODELS[name], notes[name]) for name, view in views.items()]
    for name, view in views.items():
        note = f"this view {view.rmse_dn:.2f} DN, colours ±{two_digits(limit)} DN"
        cells.append(_cell(_signed(residuals[name], limit), _RESIDUALS[name], note))
    if FOUND in views:
        drawn = chart(falloff_chart({_MODELS[name]: (views[name].off_axis, residuals[name]) for name in views}),
                      "the error towards the corners")  # fmt: skip
        cells.append(f'<div class="curve">{drawn}</div>')
    return cells


def where_most_goes(comparison: Comparison, images: ModelImages) -> Detail:
    """Returns the window in which the found effects reduce the squared error most, or the one with the largest error if
    none was found. It searches the held-out frames, or the train frames if there are none."""
    frames = comparison.capture.split("test") or comparison.capture.split("train")
    best, found = -np.inf, None
    for frame in frames:
        for side in SIDES:
            key = frame.id, side
            fall = known_residual(comparison, key, images[BASE]) ** 2
            if FOUND in images:
                fall -= known_residual(comparison, key, images[FOUND]) ** 2
            amount, rows, columns = _largest_window(np.nan_to_num(fall))
            if amount > best:
                best, found = amount, Detail(frame, side, rows, columns)
    assert found is not None, "a comparison has frames"
    return found


def _largest_window(values: NDArray[np.float64]) -> tuple[float, slice, slice]:
    """Returns (sum, rows, columns) of the detail-sized window with the largest sum of `values` [height][width]."""
    share = min(max(_DETAIL, _LEAST_PX / values.shape[1]), 1.0)
    height, width = (max(1, round(share * size)) for size in values.shape)
    sums = np.zeros((values.shape[0] + 1, values.shape[1] + 1))
    sums[1:, 1:] = values.cumsum(0).cumsum(1)
    inside = sums[height:, width:] - sums[:-height, width:] - sums[height:, :-width] + sums[:-height, :-width]
    top, left = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return float(inside[top, left]), slice(int(top), int(top) + height), slice(int(left), int(left) + width)


def _gray(image: NDArray, high: float) -> NDArray[np.uint8]:
    """Converts an image in DN to grey RGB, uint8 [height][width][3], on the explorer's square-root scale. high: the DN
    of white."""
    return coloured(np.sqrt(np.clip(image / high, 0.0, 1.0)), "gray")


def _signed(residual: NDArray[np.float64], limit_dn: float) -> NDArray[np.uint8]:
    return coloured(0.5 + 0.5 * residual / limit_dn, "RdBu_r")


def _cell(pixels: NDArray[np.uint8], title: str, note: str) -> str:
    said = f'<span class="muted">{text(note)}</span>' if note else ""
    image = f'<img alt="{text(title)}" src="{data_address(pixels)}">'
    return f"<figure>{image}<figcaption><b>{text(title)}</b>{said}</figcaption></figure>"
