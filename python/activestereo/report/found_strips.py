# SPDX-License-Identifier: Apache-2.0
"""The found effects and the user's own under a slider of their strength, in the first screen's part of the capture's
picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from activestereo.compare.effect_strip import StripView
from activestereo.compare.nuisances import Nuisances
from activestereo.report.first_screen import where_most_goes
from activestereo.report.strip_page import strip_section

if TYPE_CHECKING:
    from activestereo.compare.compare import Comparison
    from activestereo.effects import Effect
    from activestereo.report.models import ModelImages


def found_strips(
    comparison: Comparison, diagnosis: Mapping[str, Any], images: ModelImages, effects: Mapping[str, Effect]
) -> list[str]:
    """A section for each found or user's effect with fitted values; the values stand in the middle."""
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
