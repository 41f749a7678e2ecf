# SPDX-License-Identifier: Apache-2.0
"""Draws effects as strips of three pictures: without the effect, with it, and the difference. A figure shows each
effect at typical parameter values. A page adds a slider of the effect's strength."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from activestereo.common.html_table import text
from activestereo.common.palette import INK, MUTED
from activestereo.common.shown import two_digits
from activestereo.effects.core.model import Nuisances
from activestereo.effects.core.surfaces import SURFACES
from activestereo.report.effect_pictures import StripView
from activestereo.report.first_screen import where_most_goes
from activestereo.report.page import coloured, data_address, page, web_file

if TYPE_CHECKING:
    from activestereo.compare.compare import Comparison
    from activestereo.effects import Effect
    from activestereo.report.effect_pictures import EffectStrip
    from activestereo.report.models import ModelImages

_PANEL_IN = 4.2
_SHOWN_QUANTILE = 0.998
# A difference whose standard deviation is less than this share of its mean size counts as the same everywhere.
_FLAT = 0.02


def strip_figure(strips: Sequence[EffectStrip]) -> Figure:
    """Draws a row of three pictures for each strip: without the effect, with it, and the difference."""
    aspect = strips[0].without.shape[0] / strips[0].without.shape[1]
    figure = Figure(figsize=(3.35 * _PANEL_IN, len(strips) * (_PANEL_IN * aspect + 0.75)), layout="constrained")
    rows = np.atleast_1d(np.asarray(figure.subfigures(len(strips), 1), dtype=object))
    for row, strip in zip(rows, strips, strict=True):
        title = f"{strip.effect.id}: {parameter_words(strip)}".removesuffix(": ")
        row.suptitle(title, size=11, color=INK, x=0.01, ha="left")
        _panels(row, strip)
    return figure


def parameter_words(strip: EffectStrip) -> str:
    """Returns the strip's parameter values with their units as text. The selection of surfaces is left out."""
    units = {p.name: "" if p.unit == "1" else f" {p.unit}" for p in strip.effect.parameters}
    said = {name: value for name, value in strip.parameters.items() if name != SURFACES.name}
    return ", ".join(f"{name} {value:.4g}{units[name]}" for name, value in said.items())


def strip_ranges(strip: EffectStrip) -> tuple[float, float]:
    """Returns the upper ends of a strip's two colour scales, each the 99.8 % quantile and at least 1e-6. The first is
    for the pictures, in the strip's unit; the second for the change, in shown_change()'s unit: of the pixels that stay,
    if any of them changes."""
    shown = lambda image: max(float(np.quantile(image, _SHOWN_QUANTILE)), 1e-6)  # noqa: E731
    change = np.abs(shown_change(strip)[0])
    lasting = change[strip.stays]
    return shown(strip.without), shown(lasting if lasting.any() else change)


def is_flat(strip: EffectStrip) -> bool:
    """Returns whether the effect changes all pixels of an infrared picture by nearly the same DN; false for depth."""
    size = float(np.abs(strip.difference).mean())
    return strip.unit == "DN" and float(strip.difference.std()) < _FLAT * size


def shown_change(strip: EffectStrip, as_share: bool | None = None) -> tuple[NDArray[np.float64], str]:
    """Returns (change [height][width], its unit). The change is the strip's difference, or its percentage of the
    picture without the effect. as_share: whether to return the percentage; None: return it if is_flat()."""
    if is_flat(strip) if as_share is None else as_share:
        return 100.0 * strip.difference / np.maximum(strip.without, 1.0), "% of the picture"
    return strip.difference, strip.unit


def _panels(row: Figure, strip: EffectStrip) -> None:
    axes = row.subplots(1, 3)
    is_light = strip.unit == "DN"
    (high, limit), (change, unit) = strip_ranges(strip), shown_change(strip)
    span = {"cmap": "gray" if is_light else "viridis", "vmin": 0.0, "vmax": high}
    signed = {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit}
    panels = (("without", strip.without, span), ("with it", strip.with_it, span), ("difference", change, signed))
    for place, (name, image, style) in zip(axes, panels, strict=True):
        shown = place.imshow(image, interpolation="nearest", **style)
        place.set_title(name, size=10, color=MUTED, loc="left")
        place.set_xticks([])
        place.set_yticks([])
        bar = row.colorbar(shown, ax=place, shrink=0.85, extend="both" if name == "difference" else "max")
        bar.set_label(unit if name == "difference" else strip.unit, size=9, color=MUTED)
        bar.ax.tick_params(labelsize=8, colors=MUTED)


def strip_page(effects: Sequence[Sequence[EffectStrip]]) -> str:
    """Returns an HTML page with a section for each effect. effects: for each effect, its strips in order of strength;
    the middle one is shown first."""
    sections = [strip_section(strips, strips[0].effect.id, "typical") for strips in effects]
    return page("What effects do to a picture", sections, ("strip.js",))


def strip_section(strips: Sequence[EffectStrip], title: str, middle_words: str) -> str:
    """Returns the HTML of one effect's section, whose slider web/strip.js moves. strips: by rising strength;
    middle_words: the name of the middle strength, which is shown first."""
    middle, effect = strips[len(strips) // 2], strips[0].effect
    (high, limit), is_share = strip_ranges(middle), is_flat(middle)
    colours = "gray" if middle.unit == "DN" else "viridis"
    shade = lambda image: data_address(coloured(image / high, colours))  # noqa: E731
    strengths = [
        {
            "words": parameter_words(strip),
            "with_it": shade(strip.with_it),
            "difference": data_address(coloured(0.5 + 0.5 * shown_change(strip, is_share)[0] / limit, "RdBu_r")),
        }
        for strip in strips
    ]
    parts = {
        "id": text(effect.id),
        "title": text(title),
        "middle": text(middle_words),
        "summary": text(effect.summary),
        "without": shade(middle.without),
        "last": str(len(strips) - 1),
        "typical": str(len(strips) // 2),
        "scale": text(f"0 to {high:.3g} {middle.unit}"),
        "signed": text(f"\u00b1{two_digits(limit)} {shown_change(middle)[1]}"),
        # A "<" would end the script element early.
        "strengths": json.dumps(strengths).replace("<", "\\u003c"),
    }
    return Template(web_file("strip.html")).substitute(parts)


def found_strips(
    comparison: Comparison, diagnosis: Mapping[str, Any], images: ModelImages, effects: Mapping[str, Effect]
) -> list[str]:
    """Returns HTML sections with strips of the effects that the diagnosis found, and of the user's own effects. The
    middle of each slider has the fitted values. The strips show the part of the image that where_most_goes() returns.
    images: from model_images(). effects: {id: Effect}."""
    fitted = {e["effect"]: {n: p["value"] for n, p in e["parameters"].items()} for e in diagnosis["ranking"]}
    fitted |= {e["id"]: e.get("parameters", {}) for e in diagnosis.get("model", {}).get("effects", [])}
    shown = [n for n in dict.fromkeys([*diagnosis["added"], *diagnosis.get("own", {})]) if n in fitted and n in effects]
    if not shown:
        return []
    part, nuisances = where_most_goes(comparison, images), Nuisances(**comparison.scores["fit"]["nuisances"])
    window = part.rows, part.columns
    sections = []
    for name in shown:
        base = comparison.model.without_effect(name)
        view = StripView(comparison.capture, part.frame, comparison.layers[part.frame.id], nuisances, part.side, base)
        strips = [
            replace(strip, without=strip.without[window], with_it=strip.with_it[window])
            for strip in view.strengths(effects[name], fitted[name])
        ]
        sections.append(strip_section(strips, f"What {name} does here", "as fitted"))
    return sections
