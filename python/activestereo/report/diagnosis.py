# SPDX-License-Identifier: Apache-2.0
"""Writes the report's sections on a diagnosis: the missing effect, effects that cannot be told apart, the next
measurement."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from activestereo.common.html_table import table, text
from activestereo.common.shown import listed
from activestereo.diagnose.words import alike
from activestereo.report.diagnosis_text import (
    EXPLAINS_WORDS,
    FLOOR_WORDS,
    NATS_WORDS,
    parameter_text,
    says_nothing,
    split_sentences,
)
from activestereo.report.models import ROWS
from activestereo.report.page import section, share_bar

_NO_IMAGE = '<span class="muted small">no expected image of its own</span>'
_EMPTY = ("—", _NO_IMAGE)  # a column of these is left out
_ENGINE_VERDICT = {
    "effect": "It has a fault",
    "none": "It has no fault that another matcher would not show as well",
    "undetermined": "This data cannot tell whether it has a fault",
}


def diagnosis_sections(diagnosis: dict[str, Any], shown: Iterable[str] = ()) -> list[str]:
    """Returns the HTML sections on a diagnosis, the contents of diagnose.json (report/schema/diagnose.schema.json).
    shown: effects whose residual images are on the page."""
    parts = []
    if model := diagnosis.get("residual_model"):
        rows = [
            [text(t["term"]), f"{t['value']:+.4g}", f"{t['low']:+.3g} … {t['high']:+.3g}"]
            for t in model.get("terms", [])
        ]
        terms = table(["term", "value", "interval"], rows, numbers=(1, 2)) if rows else ""
        stage = f"<p class='muted small'>Stage: {text(model['stage'].lower())}</p>"
        parts.append(section("Model of what is left", f"<p>{text(model['text'])}</p>{stage}{terms}"))
    if diagnosis.get("geometry"):
        told = "".join(f"<li>{text(entry['text'])}</li>" for entry in diagnosis["geometry"])
        parts.append(section("What stands elsewhere than the capture says", f"<ul>{told}</ul>"))
    if diagnosis["ranking"]:
        parts.append(_ranking(diagnosis, shown))
    if diagnosis.get("depth", {}).get("ranking"):
        parts.append(_depth_engine(diagnosis["depth"]))
    if diagnosis.get("depth_split"):
        said = (f"<p>{text(sentence)}</p>" for sentence in split_sentences(diagnosis["depth_split"]))
        parts.append(section("What the depth's error is made of", *said))
    if diagnosis["next_measurement"]:
        items = []
        for advice in diagnosis["next_measurement"]:
            between = "".join(f'<span class="tag">{text(effect)}</span>' for effect in advice.get("separates", []))
            apart = f"<br><span class='muted'>tells</span> {between}" if between else ""
            items.append(f"<li>{text(advice['text'])}{apart}</li>")
        parts.append(section("What to measure next", f"<ul>{''.join(items)}</ul>"))
    return parts


def _ranking(diagnosis: dict[str, Any], shown: Iterable[str]) -> str:
    rows, ranking, own = [], diagnosis["ranking"], diagnosis.get("own", {})
    for place, entry in enumerate(ranking, 1):
        if entry["effect"] not in own and (place > ROWS or says_nothing(entry)):
            continue
        values = "<br>".join(text(parameter_text(name, p)) for name, p in entry["parameters"].items())
        twins = "".join(f'<span class="tag">{text(e)}</span>' for e in alike(diagnosis, entry)) or "—"
        name = f"<b>{text(entry['effect'])}</b><br><span class='muted'>{text(entry['family'])}</span>"
        if entry["effect"] in own:
            name += f"<br><span class='small'>yours: {text(own[entry['effect']])}</span>"
        share = entry.get("explained_share")
        explains = "—" if share is None else share_bar(share) + f"{100 * share:.0f} %"
        rows.append([f"{place}", name, f"{entry['score_nats']:.1f}", explains, values, twins,
                     _residual(entry["effect"], shown)])  # fmt: skip
    head = [
        "", "effect, family", "gain, nats", "explains", "fitted value (90 %)", "cannot be told from",
        "what it leaves",
    ]  # fmt: skip
    used = [any(row[column] not in _EMPTY for row in rows) for column in range(len(head))]
    head, *rows = ([cell for cell, is_used in zip(row, used, strict=True) if is_used] for row in [head, *rows])
    placed = {entry["effect"] for entry in ranking}
    silent = [entry["effect"] for entry in ranking if says_nothing(entry) and entry["effect"] not in own]
    said = f"<p>Nothing speaks for {text(listed(silent))}.</p>" if silent else ""
    left_out = "".join(f"<p>{text(n)}, yours: {text(why)}</p>" for n, why in own.items() if n not in placed)
    more = len(ranking) - len(rows) - len(silent)
    rest = left_out + (f'<p class="muted small">{more} more in diagnose.json.</p>' if more else "")
    words = [NATS_WORDS, *([EXPLAINS_WORDS] if "explains" in head else []), FLOOR_WORDS]
    legend = f'<p class="muted small">Gain in {"; ".join(words)}.</p>'
    note = (
        '<p class="muted small">What it leaves: the residual of the frame and camera chosen above when this effect '
        "alone is added; projector, ambient and black level are fitted again, focal lengths and albedos are not. A "
        "click shows it among the large pictures.</p>"
    )
    return section("Ranking", note if shown else "", table(head, rows, numbers=(2,), wide=True), said, legend, rest)


def _residual(effect_id: str, shown: Iterable[str]) -> str:
    if effect_id not in shown:
        return _NO_IMAGE
    canvas = f'<canvas data-model="{text(effect_id)}" tabindex="0" title="show it large"></canvas>'
    return f'<figure class="row">{canvas}<figcaption></figcaption></figure>'


def _depth_engine(depth: dict) -> str:
    """Returns the HTML section on effects of the depth engine. It marks differences that come from the matcher and are
    no fault of the sensor."""
    rows = []
    for entry in depth["ranking"]:
        values = "<br>".join(text(parameter_text(name, p)) for name, p in entry["parameters"].items())
        kind = "added" if entry["effect"] in depth["added"] else ""
        kind = "not a fault of the sensor" if entry["nuisance"] else kind
        share = share_bar(entry["explained_share"]) + f"{100 * entry['explained_share']:.0f} %"
        rows.append([f"<b>{text(entry['effect'])}</b>", f"{entry['score_nats']:.1f}", share, values, kind])
    head = ["effect", "gain, nats", "of the disparity error", "fitted value (90 %)", ""]
    said = f'<p class="headline"><b>{_ENGINE_VERDICT[depth["verdict"]]}</b></p>'
    reason = f"<p>{text(depth['reason'])}</p>" if depth["reason"] else ""
    return section("The depth engine", said, reason, table(head, rows, numbers=(1,), wide=True))
