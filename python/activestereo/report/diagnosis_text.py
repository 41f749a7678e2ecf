# SPDX-License-Identifier: Apache-2.0
"""A diagnosis for reading in a terminal: the verdict in ten lines, then the table."""

from collections.abc import Mapping
from typing import Any

from activestereo.diagnose.answer.verdict_words import (
    alike,
    error_text,
    errors_told,
    geometry_words,
    headline,
    next_steps,
    rivals,
)
from activestereo.report.depth_parts import depth_parts_lines

NATS_WORDS = "nats: the logarithm of how much likelier the effect makes the images"
_EXPLAINS_WORDS = "explains: share of the squared error beyond noise (noise effects: of the noise, no error)"
_SHOWN = 8
_BAR = 40
_LARGEST_SUMMARY = 10
_LEAST_TOLD = 0.005
_LEAST_NATS = 0.05  # is told as more than 0.0


def parameter_text(name: str, found: Mapping[str, Any]) -> str:
    """One parameter of a ranking's entry for reading: a choice by its materials, else value, interval and unit."""
    if "materials" in found:
        return f"on {', '.join(found['materials']) or 'all surfaces'}"
    interval = "" if found["low"] is None or found["high"] is None else f" ({found['low']:.4g} to {found['high']:.4g})"
    return f"{name} {found['value']:.4g}{interval}" + ("" if found["unit"] in ("", "1") else f" {found['unit']}")


def diagnosis_text(result: Mapping[str, Any]) -> str:
    """The command's text: verdict_text(), then the full table."""
    lines = [verdict_text(result), "", *_probabilities(result)]
    lines += _table(result)
    if (size := result.get("binning", 1)) > 1:
        lines.append(f"searched in images averaged over {size}x{size} pixels (--bin); figures are of whole images")
    lines += _depth_lines(result.get("depth")) + depth_parts_lines(result.get("depth_split"))
    lines += [f"next measurement: {advice['text']}" for advice in result["next_measurement"][1:]]
    if result.get("residual_model"):
        lines.append(f"model of the residual ({result['residual_model']['stage']}): {result['residual_model']['text']}")
    return "\n".join(lines)


def verdict_text(result: Mapping[str, Any]) -> str:
    """The verdict in ten lines at most: a sentence, the errors as bars, the effects found, the next step."""
    added = f" ({', '.join(result['added'])})" if result["added"] else ""
    lines = [headline(result), f"verdict: {result['verdict']}{added}"]
    if result.get("reason") and result["verdict"] != "undetermined":
        lines.append(result["reason"])
    lines += geometry_words(result)
    lines += _errors(result)
    found = {entry["effect"]: entry for entry in result["ranking"]}
    lines += [f"{name}: {_values(found[name])}" for name in result["added"] if found.get(name, {}).get("parameters")]
    if others := rivals(result):
        lines.append(f"this data cannot tell {result['ranking'][0]['effect']} from {', '.join(others)}")
    if (result.get("depth") or {}).get("added"):
        lines.append(f"depth engine: {', '.join(result['depth']['added'])}")
    steps = [f"next: {step}" for step in next_steps(result)]
    return "\n".join([*lines[: _LARGEST_SUMMARY - min(len(steps), 2)], *steps[:2]])


def _probabilities(result: Mapping[str, Any]) -> list[str]:
    """A line of probabilities that add up to 1: the candidates, nothing, and something else."""
    given = result.get("probabilities")
    if given is None:
        return []
    of = given["named"] | {"nothing": given["none"], "something else": given["something_else"]}
    return ["probability: " + ", ".join(f"{name} {p:.2f}" for name, p in of.items() if p >= _LEAST_TOLD), ""]


def _errors(result: Mapping[str, Any]) -> list[str]:
    """Held-out errors before and after beside the noise, as numbers and bars."""
    rows, floor = errors_told(result), result["heldout_noise_floor"]
    if not rows:
        return []
    rows += [] if floor is None else [("noise alone", floor)]
    most = max(value for _, value in rows) or 1.0
    lines = []
    for name, value in rows:
        said = f"{value:.3f} DN" if name == "noise alone" else error_text(value, floor, 3)
        lines.append(f"  {name:22}{said:>20}  {'█' * max(1, round(_BAR * value / most))}")
    return lines


def _table(result: Mapping[str, Any]) -> list[str]:
    """The ranking's first rows with a gain and the user's own effects, each with those that it cannot be told from."""
    ranking, own = result["ranking"], result.get("own", {})
    told = [
        (place, entry)
        for place, entry in enumerate(ranking, 1)
        if entry["effect"] in own or (place <= _SHOWN and entry["score_nats"] >= _LEAST_NATS)
    ]
    lines = (
        [f"{'':4}{'effect':26}{'family':20}{'nats':>12}{'explains':>10}{'confidence':>12}  parameters (90 %)"]
        if told
        else []
    )
    for place, entry in told:
        values, part = _values(entry), entry["explained_share"]
        share, confidence = "-" if part is None else f"{100 * part:.0f} %", f"{entry['confidence']:.2f}"
        lines.append(
            f"{place:>2}  {entry['effect']:26}{entry['family']:20}{entry['score_nats']:>12.1f}{share:>10}"
            f"{confidence:>12}  {values}"
        )
        lines += [f"{'':6}{words}" for words in _notes(result, entry)]
    placed = {entry["effect"] for entry in ranking}
    lines += [f"{NATS_WORDS}; {_EXPLAINS_WORDS}"] if told else []
    return lines + [f" -  {name:26}yours: {why}" for name, why in own.items() if name not in placed]


def _notes(result: Mapping[str, Any], entry: Mapping[str, Any]) -> list[str]:
    others, own = alike(result, entry), result.get("own", {})
    notes = [f"cannot be told from {', '.join(others)}"] if others else []
    return notes + ([f"yours: {own[entry['effect']]}"] if entry["effect"] in own else [])


def _values(entry: Mapping[str, Any]) -> str:
    return ", ".join(parameter_text(name, found) for name, found in entry["parameters"].items())


def _depth_lines(depth: Mapping[str, Any] | None) -> list[str]:
    """The verdict on the depth engine, its added effects, and differences that are no fault of the sensor."""
    if not depth:
        return []
    lines = [f"depth engine: {depth['verdict']}" + (f" ({depth['reason']})" if depth["reason"] else "")]
    for entry in depth["ranking"]:
        if entry["effect"] in depth["added"] or (entry["nuisance"] and entry["score_nats"] > 0):
            kind = "not a fault of the sensor" if entry["nuisance"] else "added"
            lines.append(
                f"  {entry['effect']}, {kind}: {_values(entry)}; {100 * entry['explained_share']:.0f} % of its error"
            )
    return lines
