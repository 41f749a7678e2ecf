# SPDX-License-Identifier: Apache-2.0
"""Effects as a page: a picture without the effect, with it, and the difference, under a slider of its strength."""

from __future__ import annotations

import json
from collections.abc import Sequence
from string import Template
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from activestereo.common.html_table import text
from activestereo.report.encode import data_address
from activestereo.report.page import page, web_file
from activestereo.report.strip_figure import is_flat, parameter_words, shown_change, strip_ranges

if TYPE_CHECKING:
    from activestereo.compare.effect_strip import EffectStrip


def strip_page(effects: Sequence[Sequence[EffectStrip]]) -> str:
    """A document with a section for each effect: its strips by rising strength, the middle one shown first."""
    sections = [strip_section(strips, strips[0].effect.id, "typical") for strips in effects]
    return page("What effects do to a picture", sections, ("strip.js",))


def strip_section(strips: Sequence[EffectStrip], title: str, middle_words: str) -> str:
    """A section for a page with strip.js. middle_words: the strength that is shown first."""
    middle, effect = strips[len(strips) // 2], strips[0].effect
    (high, limit), is_share = strip_ranges(middle), is_flat(middle)
    colours = "gray" if middle.unit == "DN" else "viridis"
    shade = lambda image: _shaded(image / high, colours)  # noqa: E731
    strengths = [
        {
            "words": parameter_words(strip),
            "with_it": shade(strip.with_it),
            "difference": _shaded(0.5 + 0.5 * shown_change(strip, is_share)[0] / limit, "RdBu_r"),
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
        "signed": text(f"\u00b1{limit:.2g} {shown_change(middle)[1]}"),
        # A "<" would end the script element early.
        "strengths": json.dumps(strengths).replace("<", "\\u003c"),
    }
    return Template(web_file("strip.html")).substitute(parts)


def _shaded(share: NDArray[np.float64], colours: str) -> str:
    rgb = np.asarray(colormaps[colours](np.clip(share, 0.0, 1.0)))[..., :3]
    return data_address(np.rint(255.0 * rgb).astype(np.uint8))
