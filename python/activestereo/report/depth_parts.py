# SPDX-License-Identifier: Apache-2.0
"""The parts of a depth error (diagnose/answer/depth_split.py) for reading: in a terminal, and as a report's section."""

from collections.abc import Mapping
from typing import Any

from activestereo.common.html_table import table, text
from activestereo.report.page import section, share_bar

# The sensor's own error and its parts.
_OWN = "sensor's own"
_WHOLE = ("image effects", "any matcher", _OWN)
_MADE_OF = ("filters", "calibration", "temperature", "other matcher")
_WORDS = {
    "image effects": "what the model's effects on the images do to matched depth",
    "any matcher": "what our matcher makes of the same images beside",
    _OWN: "what the device makes of these images that our matcher does not, which is",
    "filters": "the depth engine's effects that were found",
    "calibration": "an offset and a scale of disparity",
    "temperature": "their change per kelvin",
    "other matcher": "the rest",
    "beside simulated depth": "the device's depth less the model's, with the noise of both",
}
_CAVEAT = "the images still lack something, which stands under 'any matcher'"
_MATERIALS = 5  # rows on the terminal
_MODELS = {"before": "given model", "after": "model.json"}

Split = Mapping[str, Any]


def depth_parts_lines(split: Split | None) -> list[str]:
    """Lines of the terminal: all parts under both models, then those of model.json by distance and by the largest
    materials."""
    if not split:
        return []
    caveat = "" if split["images_agree"] else f"; {_CAVEAT}"
    lines = [f"depth against the geometry, {split['pixels']} pixels, RMS and share of its square{caveat}"]
    lines.append(f"  {'':24}" + "".join(f"{name:>28}" for name in _MODELS.values()))
    for name, figures in _rows(split):
        indent = "  " * (2 if name in _MADE_OF else 1)
        lines.append(f"{indent + name:26}" + "".join(f"{_said(figures[when]):>28}" for when in _MODELS))
    lines.append(f"  {'model.json':24}{'whole':>28}" + "".join(f"{name:>28}" for name in _WHOLE))
    for name, part in _places(split, _MATERIALS):
        told = [part["after"], *(part["after"]["parts"][own] for own in _WHOLE)]
        lines.append(f"  {name:24}" + "".join(f"{_said(figures):>28}" for figures in told))
    return lines


def depth_parts_section(split: Split | None) -> str:
    """The same as a section of a page; empty if there are no parts."""
    if not split:
        return ""
    note = f"<p>{split['pixels']} pixels where both engines measured." + (
        "</p>" if split["images_agree"] else f" {text(_CAVEAT.capitalize())}.</p>"
    )
    rows = []
    for name, figures in _rows(split):
        told = [figures[when] for when in _MODELS]
        bars = [(share_bar(own["share_m"]) if "share_m" in own else "") + text(_said(own)) for own in told]
        label = text(name) if name in _MADE_OF else f"<b>{text(name)}</b>"
        rows.append([label, f"<span class='muted'>{text(_WORDS.get(name, ''))}</span>", *bars])
    whole = table(["part", "", *_MODELS.values()], rows, wide=True)
    places = [
        [text(name), text(_said(p["after"])), *(text(_said(p["after"]["parts"][own])) for own in _WHOLE)]
        for name, p in _places(split)
    ]
    by_place = table(["under model.json", "whole", *_WHOLE], places, wide=True)
    return section("What the depth's error is made of", note, whole, by_place)


def _rows(split: Split) -> list[tuple[str, dict[str, Any]]]:
    """(name, {"before" or "after": figures}) of the error, of the model's rest, and of each part."""
    rows: list[tuple[str, dict[str, Any]]] = [("whole error", {when: split[when] for when in _MODELS})]
    for name in (*_WHOLE, *_MADE_OF):
        rows.append((name, {when: split[when]["parts"][name] for when in _MODELS}))
    beside = {
        when: {"rms_m": split[when]["beside_model_m"], "rms_px": split[when]["beside_model_px"]} for when in _MODELS
    }
    return [*rows, ("beside simulated depth", beside)]


def _places(split: Split, most: int | None = None) -> list[tuple[str, Split]]:
    """(name, its split) of each distance, and of the materials that fill most, so many or all."""
    rows = [(f"{row['from_m']:.2f} to {row['to_m']:.2f} m", row) for row in split["by_distance"]]
    return rows + [(row["material"], row) for row in split["by_material"][:most]]


def _said(figures: Mapping[str, float]) -> str:
    """RMS in mm and px; for a part also its share of the mean square in mm."""
    share = f" {round(100 * figures['share_m']):4d} %" if "share_m" in figures else ""
    rms_mm, rms_px = round(1e3 * figures["rms_m"], 2) + 0.0, round(figures["rms_px"], 3) + 0.0  # no negative zero
    return f"{rms_mm:.2f} mm {rms_px:.3f} px{share}"
