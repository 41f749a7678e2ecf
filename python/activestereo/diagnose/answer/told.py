# SPDX-License-Identifier: Apache-2.0
"""Shows a diagnosis as sentences, a table and a figure, for use in Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from activestereo.common.html_table import table, text
from activestereo.diagnose.answer.verdict_words import alike, headline, next_steps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BARS, _ROWS = 10, 5


def explained(result: Mapping[str, Any], effect_id: str) -> str:
    """Returns a sentence on why an effect was named, or why not."""
    skipped = {entry["effect"]: entry["reason"] for entry in result["not_ranked"]}
    if effect_id in skipped:
        return f"{effect_id} was not judged: {skipped[effect_id]}"
    entry = next((entry for entry in result["ranking"] if entry["effect"] == effect_id), None)
    if entry is None:
        return f"{effect_id} explains next to nothing of the images"
    gain = f"{effect_id} explains {entry['gain_reduced_chi2']:.3g} noise variances ({entry['score_nats']:.0f} nats)"
    if effect_id in result["added"]:
        others = ", ".join(entry["equivalent"])
        return f"{gain} and was named" + (f"; this recording cannot tell it from {others}" if others else "")
    first = result["ranking"][0]
    if first is entry:
        return f"{gain}, more than any other effect, and was not named: the verdict is '{result['verdict']}'"
    if effect_id in first["equivalent"]:
        return f"{gain}: this recording cannot tell it from {first['effect']}"
    rest = f"{first['effect']} explains {first['gain_reduced_chi2']:.3g} ({first['score_nats']:.0f} nats)"
    return f"{gain}, {rest}"


def ranking_figure(result: Mapping[str, Any]) -> Figure:
    """Returns a bar chart of each ranked effect's gain in noise variances; bars of named effects are filled."""
    from matplotlib.figure import Figure

    entries = result["ranking"][:_BARS][::-1]
    figure = Figure(figsize=(6.4, 0.6 + 0.3 * max(len(entries), 1)), layout="constrained")
    axes = figure.subplots()
    colours = ["C0" if entry["effect"] in result["added"] else "0.8" for entry in entries]
    axes.barh([entry["effect"] for entry in entries], [entry["gain_reduced_chi2"] for entry in entries], color=colours)
    axes.set_xlabel("explained, noise variances")
    return figure


def html_of(result: Mapping[str, Any]) -> str:
    """Returns HTML with the verdict, the first rows of the ranking and the next steps. result: diagnose.json's
    contents."""
    rows = [
        [
            text(entry["effect"]),
            f"{entry['score_nats']:.1f}",
            "—" if entry["explained_share"] is None else f"{100 * entry['explained_share']:.0f} %",
            text(", ".join(alike(result, entry))) or "—",
        ]
        for entry in result["ranking"][:_ROWS]
    ]
    head = ["effect", "gain, nats", "explains", "cannot be told from"]
    ranking = table(head, rows, numbers=(1, 2)) if rows else ""
    advice = "".join(f"<li>{text(step)}</li>" for step in next_steps(result))
    return f"<p><b>{text(headline(result))}</b></p>{ranking}<ul>{advice}</ul>"
