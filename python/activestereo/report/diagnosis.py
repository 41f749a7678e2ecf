# SPDX-License-Identifier: Apache-2.0
"""Formats a diagnosis as text for the terminal and as HTML sections for the report. The text is the final screen, the
tables of --verbose, and sentences on the parts of the depth error (diagnose/depth_split.py)."""

from collections.abc import Iterable, Mapping, Sequence
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.common.html_table import table, text
from activestereo.common.shown import listed, without_unit
from activestereo.diagnose.words import (
    alike,
    error_text,
    errors_of,
    errors_told,
    geometry_words,
    headline,
    next_steps,
    rival_words,
)
from activestereo.report.page import section, share_bar
from activestereo.report.screen import Figure, Step, screen, wrapped

_WORDS = {
    "any matcher": "what any matcher makes of these images",
    "image effects": "the effects found in the images",
    "filters": "the depth engine's effects",
    "calibration": "an offset and a scale of disparity",
    "temperature": "their change with temperature",
    "other matcher": "the device's own matching",
}


def split_sentences(split: Mapping[str, Any] | None) -> list[str]:
    """Returns sentences on the device's depth error with model.json applied. They state its RMS, the causes of its
    square in whole percents that sum to 100, and its RMS at each distance. split: diagnose.json's depth_split; None: no
    sentences."""
    if not split:
        return []
    whole = split["after"]
    size = f"{1e3 * whole['rms_m']:.2f} mm ({whole['rms_px']:.3f} px)"
    said = [f"The device's depth errs by {size} against the geometry, RMS of {split['pixels']} pixels."]
    percent = _whole_percents([whole["parts"][name]["share_m"] for name in _WORDS])
    parts = sorted(zip(percent, _WORDS.values(), strict=True), key=lambda part: -part[0])
    makes = listed([f"{share} % comes from {words}" for share, words in parts if share > 0])
    takes = listed([f"{-share} % by {words}" for share, words in parts if share < 0])
    said.append(f"Of the square of that error {makes}" + (f", less {takes}." if takes else "."))
    if not split["images_agree"]:
        said.append("The images still lack something, which counts as any matcher's.")
    rows = split["by_distance"]
    places = [f"{1e3 * r['after']['rms_m']:.2f} mm at {r['from_m']:.2f} to {r['to_m']:.2f} m" for r in rows]
    return [*said, f"It is {listed(places)}."]


def _whole_percents(shares: Sequence[float]) -> list[int]:
    """Rounds shares that sum to 1 to whole percents that sum to 100, by largest remainder."""
    exact = 100.0 * np.asarray(shares)
    down = np.floor(exact).astype(int)
    short = round(exact.sum()) - int(down.sum())
    down[np.argsort(down - exact, kind="stable")[:short]] += 1
    return [int(share) for share in down]


NATS_WORDS = "nats: the logarithm of how much likelier the effect makes the images"
EXPLAINS_WORDS = "explains: share of the squared error beyond noise (noise effects: of the noise, no error)"
FLOOR_WORDS = "floor: the part of an interval that formulas and scenes, which are inexact, have put under it"
_SHOWN, ROWS = 8, 12  # the ranked effects that the terminal and the report show
_ALL = 0.95  # a floor above this share of an interval is printed as all of it
_LEAST_NATS = 0.05  # the least gain that prints as more than 0.0


def parameter_text(name: str, found: Mapping[str, Any]) -> str:
    """Returns a fitted parameter as text: its materials if it selects surfaces, else value, interval and unit."""
    if "materials" in found:
        return f"on {', '.join(found['materials']) or 'all surfaces'}"
    unit = "" if found["unit"] in ("", "1") else f" {found['unit']}"
    value, low, high, floor = found["value"], found["low"], found["high"], found.get("floor")
    shown = without_unit(name, found["unit"])
    if low is None or high is None:
        return f"{shown} {value:.4g}{unit}"
    half = max(high - value, value - low)
    least = f", floor ±{floor:.2g}" if floor else ""
    if half <= 0.0 or not isclose(high - value, value - low, rel_tol=0.01):  # it meets an end of the range
        return f"{shown} {value:.4g}{unit} ({low:.4g} to {high:.4g}{least})"
    decimals = max(1 - int(np.floor(np.log10(half))), 0)
    least = " (its formula's error)" if floor and floor > _ALL * half else least and f" ({least[2:]})"
    return f"{shown} {value:.{decimals}f} ±{half:.{decimals}f}{unit}{least}"


def _told_rows(result: Mapping[str, Any], most: int) -> list[tuple[int, Mapping[str, Any]]]:
    """Returns (rank from 1, entry of the ranking) for the user's own effects. It also returns the entries among the
    first `most` whose gain prints as more than 0.0 nats."""
    own, ranking = result.get("own", {}), enumerate(result["ranking"], 1)
    is_told = lambda place, row: row["effect"] in own or (place <= most and row["score_nats"] >= _LEAST_NATS)  # noqa: E731
    return [(place, row) for place, row in ranking if is_told(place, row)]


def diagnosis_screen(result: Mapping[str, Any], steps: Sequence[Step], page: Path, kept: str, verbose: bool) -> str:
    """Returns the final screen of `diagnose`. steps: commands to run next; page: the report's path; kept: text on the
    cache and times, printed if `verbose`."""
    name = f"{result['capture']}: " if result.get("capture") else ""
    words = headline(result)
    rows, floor = errors_told(result), result["heldout_noise_floor"]
    figures = [Figure(own, error_text(error, floor, 2), max(error, floor or 0.0)) for own, error in rows]
    if figures:
        words += f" {errors_of(result)}:"
        figures += [] if floor is None else [Figure("sensor noise", f"{floor:.2f} DN", floor)]
    sentence = f"{name}{words[0].lower() if name else words[0]}{words[1:]}"
    return screen(sentence, figures, _notes(result), steps, page, f"{diagnosis_table(result)}\n{kept}", verbose)


def diagnosis_table(result: Mapping[str, Any]) -> str:
    """Returns the text that --verbose adds: the ranking of effects, the depth engine's verdict and further
    measurements."""
    lines = _table(result)
    if (size := result.get("binning", 1)) > 1:
        lines.append(f"searched in images averaged over {size}x{size} pixels (--bin); figures are of whole images")
    lines += _depth_lines(result.get("depth")) + split_sentences(result.get("depth_split"))
    lines += [f"next measurement: {advice['text']}" for advice in result["next_measurement"][1:]]
    if result.get("residual_model"):
        lines.append(f"model of the residual ({result['residual_model']['stage']}): {result['residual_model']['text']}")
    return "\n".join(lines)


def _notes(result: Mapping[str, Any]) -> list[str]:
    """Returns sentences for the lines below the figures, most important first."""
    verdict, found = result["verdict"], {entry["effect"]: entry for entry in result["ranking"]}
    named = [found[name] for name in result["added"] if found.get(name, {}).get("parameters")]
    notes = [f"Warning: {text}." for text in result.get("warnings", [])]
    notes += [f"{entry['effect'] if len(named) > 1 else 'fitted'}: {_values(entry)}" for entry in named]
    notes += [f"{name}: {why}." for name, why in result.get("own", {}).items() if name not in result["added"]]
    advice, engine = next_steps(result), result.get("depth") or {}
    if verdict != "effect":
        notes += advice[:1]
    if result.get("reason") and verdict != "undetermined":
        notes.append(result["reason"])
    notes += rival_words(result) if verdict in ("effect", "undetermined") else []
    if engine and engine["verdict"] != "undetermined" and (verdict != "none" or not engine.get("added")):
        said = f"it has {', '.join(engine['added'])}" if engine.get("added") else "nothing is missing"
        notes.append(f"depth engine: {said}.")
    return [*notes, *geometry_words(result), *(advice[1:] if verdict != "effect" else advice)]


def _table(result: Mapping[str, Any]) -> list[str]:
    """Returns text rows of the ranking for the first effects with a gain, and for the user's own effects. A row names
    the effects that the data cannot tell from this one."""
    own, told = result.get("own", {}), _told_rows(result, _SHOWN)
    lines = [f"{'':4}{'effect':26}{'family':20}{'nats':>12}{'explains':>10}"] if told else []
    for place, entry in told:
        part = entry["explained_share"]
        share = "-" if part is None else f"{100 * part:.0f} %"
        lines.append(f"{place:>2}  {entry['effect']:26}{entry['family']:20}{entry['score_nats']:>12.1f}{share:>10}")
        words, others = [_values(entry)], alike(result, entry)
        words += [f"cannot be told from {', '.join(others)}"] if others else []
        words += [f"yours: {own[entry['effect']]}"] if entry["effect"] in own else []
        lines += [line for said in words for line in wrapped(said, " " * 4)]
    placed = {entry["effect"] for entry in result["ranking"]}
    lines += [NATS_WORDS, EXPLAINS_WORDS, FLOOR_WORDS] if told else []
    return lines + [f" -  {name:26}yours: {why}" for name, why in own.items() if name not in placed]


def _values(entry: Mapping[str, Any]) -> str:
    """Returns an effect's parameters as text. Parameters are left out that are 0 with an interval from 0, because they
    do nothing; if all are such, all are kept."""
    found = entry["parameters"]
    told = {name: own for name, own in found.items() if (own.get("value"), own.get("low")) != (0.0, 0.0)}
    return ", ".join(parameter_text(name, own) for name, own in (told or found).items())


def _depth_lines(depth: Mapping[str, Any] | None) -> list[str]:
    """Returns lines on the depth engine: the verdict, the added effects, and differences from our matcher that are no
    fault of the sensor."""
    if not depth:
        return []
    lines = [f"depth engine: {depth['verdict']}" + (f" ({depth['reason']})" if depth["reason"] else "")]
    for entry in depth["ranking"]:
        if entry["effect"] in depth["added"] or (entry["nuisance"] and entry["score_nats"] > 0):
            kind = "not a fault of the sensor" if entry["nuisance"] else "added"
            share = f"{100 * entry['explained_share']:.0f} % of its error"
            lines.append(f"  {entry['effect']}, {kind}: {_values(entry)}; {share}")
    return lines


_NO_IMAGE = '<span class="muted small">no expected image of its own</span>'
_EMPTY = ("—", _NO_IMAGE)  # a column of these is left out
_LEAVES = """\
What it leaves: the residual of the frame and camera chosen above when this effect alone is added; projector, ambient
and black level are fitted again, focal lengths and albedos are not. A click shows it among the large pictures."""
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
        found = model.get("terms", [])
        rows = [[text(t["term"]), f"{t['value']:+.4g}", f"{t['low']:+.3g} … {t['high']:+.3g}"] for t in found]
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
    for place, entry in _told_rows(diagnosis, ROWS):
        values = "<br>".join(text(parameter_text(name, p)) for name, p in entry["parameters"].items())
        twins = "".join(f'<span class="tag">{text(e)}</span>' for e in alike(diagnosis, entry)) or "—"
        name = f"<b>{text(entry['effect'])}</b><br><span class='muted'>{text(entry['family'])}</span>"
        if entry["effect"] in own:
            name += f"<br><span class='small'>yours: {text(own[entry['effect']])}</span>"
        share = entry.get("explained_share")
        explains = "—" if share is None else share_bar(share)
        canvas = f'<canvas data-model="{text(entry["effect"])}" tabindex="0" title="show it large"></canvas>'
        leaves = f'<figure class="row">{canvas}<figcaption></figcaption></figure>'
        leaves = leaves if entry["effect"] in shown else _NO_IMAGE
        rows.append([f"{place}", name, f"{entry['score_nats']:.1f}", explains, values, twins, leaves])
    head = ["", "effect, family", "gain, nats", "explains", "fitted value (90 %)"]
    head += ["cannot be told from", "what it leaves"]
    used = [any(row[column] not in _EMPTY for row in rows) for column in range(len(head))]
    head, *rows = ([cell for cell, is_used in zip(row, used, strict=True) if is_used] for row in [head, *rows])
    placed = {entry["effect"] for entry in ranking}
    silent = [e["effect"] for e in ranking if e["score_nats"] < _LEAST_NATS and e["effect"] not in own]
    said = f"<p>Nothing speaks for {text(listed(silent))}.</p>" if silent else ""
    left_out = "".join(f"<p>{text(n)}, yours: {text(why)}</p>" for n, why in own.items() if n not in placed)
    more = len(ranking) - len(rows) - len(silent)
    rest = left_out + (f'<p class="muted small">{more} more in diagnose.json.</p>' if more else "")
    words = [NATS_WORDS, *([EXPLAINS_WORDS] if "explains" in head else []), FLOOR_WORDS]
    legend = f'<p class="muted small">Gain in {"; ".join(words)}.</p>'
    note = f'<p class="muted small">{_LEAVES}</p>' if shown else ""
    return section("Ranking", note, table(head, rows, numbers=(2,), wide=True), said, legend, rest)


def _depth_engine(depth: dict) -> str:
    """Returns the HTML section on effects of the depth engine. It marks differences that come from the matcher and are
    no fault of the sensor."""
    rows = []
    for entry in depth["ranking"]:
        values = "<br>".join(text(parameter_text(name, p)) for name, p in entry["parameters"].items())
        kind = "added" if entry["effect"] in depth["added"] else ""
        kind = "not a fault of the sensor" if entry["nuisance"] else kind
        share = share_bar(entry["explained_share"])
        rows.append([f"<b>{text(entry['effect'])}</b>", f"{entry['score_nats']:.1f}", share, values, kind])
    head = ["effect", "gain, nats", "of the disparity error", "fitted value (90 %)", ""]
    said = f'<p class="headline"><b>{_ENGINE_VERDICT[depth["verdict"]]}</b></p>'
    reason = f"<p>{text(depth['reason'])}</p>" if depth["reason"] else ""
    return section("The depth engine", said, reason, table(head, rows, numbers=(1,), wide=True))
