# SPDX-License-Identifier: Apache-2.0
"""A diagnosis as a notebook shows it."""

from collections.abc import Mapping
from typing import Any

from activestereo.common.html_table import table, text
from activestereo.diagnose.answer.verdict_words import alike, headline, next_steps

_ROWS = 5


def html_of(result: Mapping[str, Any]) -> str:
    """The verdict, the first rows of the ranking and what to do next. result: diagnose.json's contents."""
    rows = [
        [
            text(entry["effect"]),
            f"{entry['score_nats']:.1f}",
            f"{100 * entry['confidence']:.0f} %",
            text(", ".join(alike(result, entry))) or "—",
        ]
        for entry in result["ranking"][:_ROWS]
    ]
    head = ["effect", "gain, nats", "confidence", "cannot be told from"]
    ranking = table(head, rows, numbers=(1, 2)) if rows else ""
    advice = "".join(f"<li>{text(step)}</li>" for step in next_steps(result))
    return f"<p><b>{text(headline(result))}</b></p>{ranking}<ul>{advice}</ul>"
