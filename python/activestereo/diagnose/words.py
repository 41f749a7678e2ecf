# SPDX-License-Identifier: Apache-2.0
"""Puts a diagnosis into words and pictures: its verdict, the reasons, the next steps, a table and a figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from activestereo.common.html_table import table, text
from activestereo.common.shown import listed
from activestereo.diagnose.numbers import NUMBERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RIVALS = 2  # so many are reported with their shares
# A correction beyond so many stated deviations shows that the uncertainty was stated wrong.
IMPOSSIBLE_SIGMAS = 10.0
# Advice by the family of the effect that was found. For other families the sensor itself differs.
_REMEDIES = {
    "surface": "Give the scene file's materials the values found",
    "ambient light": "Give the scene file the light found, or shade the scene and record again",
    "second projector": "Switch the second projector off and record again",
    "medium": "Clear the air and record again",
    "motion": "Hold the rig and the scene still and record again",
    "camera geometry": "Calibrate the cameras again",
}
_BARS, _ROWS = 10, 5


def beyond_stated(sigmas: float) -> str:
    """Returns a clause on a correction far beyond its stated uncertainty, of which `sigmas` is the multiple; else
    ""."""
    return f", {sigmas:.0f} times its stated uncertainty" if sigmas > IMPOSSIBLE_SIGMAS else ""


def error_text(rmse_dn: float, floor_dn: float | None, decimals: int) -> str:
    """Returns an error as text. Below the noise floor no digit is shown, as only chance makes an error so small."""
    return f"{rmse_dn:.{decimals}f} DN" if floor_dn is None or rmse_dn > floor_dn else "at the noise floor"


def errors_of(result: Mapping[str, Any]) -> str:
    """Returns a clause that says which images the held-out errors are for, and which effects these errors leave out."""
    views = "Errors of each view, predicted by the others"
    said = views if result.get("predicted_by_views") else "Errors on frames that no fit has seen"
    apart = result.get("not_predicted", [])
    return f"{said} (but for {listed(apart)}: views differ in it)" if apart else said


def errors_told(result: Mapping[str, Any]) -> list[tuple[str, float]]:
    """Returns [(label, held-out root mean square error in DN)]; empty without held-out errors. The rows are the given
    model, the same model at the estimated geometry if that differs, and the found model."""
    before, after = result["heldout_ir_rmse_before"], result["heldout_ir_rmse_after"]
    if before is None or after is None:
        return []
    standing = result.get("heldout_ir_rmse_geometry", before)
    measured = [] if standing == before else [("geometry as measured", standing)]
    last = f"with the effect{'s' * (len(result['added']) > 1)}" if result["added"] else "with its own scales"
    return [("model now", before), *measured, (last, after)]


def _named(result: Mapping[str, Any], effect_id: str) -> str:
    """Returns an effect's id, followed by its finding in parentheses if it has one."""
    entries = [*result["ranking"], *(result.get("depth") or {}).get("ranking", [])]
    meaning = next((entry.get("finding") for entry in entries if entry["effect"] == effect_id), None)
    return effect_id + (f" ({_lowered(meaning)})" if meaning else "")


def alike(result: Mapping[str, Any], entry: Mapping[str, Any]) -> list[str]:
    """Returns the ids of effects that cannot be distinguished from a row of the ranking. An effect that explains far
    more than a row may fit as well as it, but not the reverse. So, except for the first row, both must list each
    other."""
    own = entry["effect"]
    says = {other["effect"]: other["equivalent"] for other in result["ranking"]}
    is_first = result["ranking"][0]["effect"] == own
    return [x for x in entry["equivalent"] if x != own and (is_first or own in says.get(x, [own]))]


def rival_words(result: Mapping[str, Any]) -> list[str]:
    """Returns sentences on shares of the error, as in the ranking. One states what named effects explain; for a single
    name it may add its best rivals. One more sentence follows for each name that the data cannot distinguish from
    others."""
    entries = {entry["effect"]: entry for entry in result["ranking"]}
    names = [entries[own["effects"][0]] for own in result.get("sets", []) if own["effects"][0] in entries]
    named = [e for e in names if e.get("explained_share") is not None and e.get("channel") != "noise"]
    if not named:
        return []
    same = [f"This data cannot tell {e['effect']} from {listed(alike(result, e))}." for e in named if alike(result, e)]
    beside = [entries[name] for name in result["sets"][0].get("rivals", {}) if name in entries][:_RIVALS]
    shares = [entry["explained_share"] for entry in [*named, *beside]]
    if same or len(named) > 1 or not beside or shares[1] >= shares[0]:
        told = [f"{entry['effect']} {_percent(entry['explained_share'])}" for entry in named]
        return [f"Share of the error beyond noise: {listed(told)}.", *same]
    decimals = 0 if _percent(shares[0]) != _percent(shares[1]) else 1
    others = ", ".join(f"{e['effect']} {_percent(e['explained_share'], decimals)}" for e in beside)
    return [f"Rivals fit worse: it explains {_percent(shares[0], decimals)}, {others}."]


def headline(result: Mapping[str, Any]) -> str:
    """Returns the verdict in one sentence."""
    error, floor = result["heldout_ir_rmse_after"], result["heldout_noise_floor"]
    left = ""
    if error is not None and floor is not None:
        left = f" ({error_text(error, floor, 2)}, noise alone gives {floor:.2f} DN)"
    if result["verdict"] == "effect":
        added = result["added"]
        return f"The model lacks {listed([_named(result, name) for name in added])}."
    if result["verdict"] == "unknown":
        return f"Something is missing that no known effect explains{left}."
    if result["verdict"] == "none":
        engine = (result.get("depth") or {}).get("added", [])
        if engine:
            return f"The images lack nothing; the depth engine has one effect more: {_named(result, engine[0])}."
        return f"Nothing is missing: the model is at the noise floor{left}."
    reason = f": {result['reason']}" if result.get("reason") else ""
    return f"This data cannot tell what is missing{reason}."


def geometry_words(result: Mapping[str, Any]) -> list[str]:
    """Returns sentences on geometry and albedos that differ from the capture's; several views share one sentence."""
    entries = result.get("geometry", [])
    views = [entry for entry in entries if entry["what"] == "view"]
    said = [entry["text"] for entry in entries if entry["what"] != "view" or len(views) == 1]
    if len(views) > 1:
        moved, turned = (max(entry[key] for entry in views) for key in ("moved_mm", "turned_deg"))
        places = f"up to {moved:.1f} mm ({turned:.2f} degrees) from where the capture says"
        said.append(f"{len(views)} views stand {places}")
    said += [entry["text"] for entry in result.get("albedos", [])]
    return [f"{words[0].upper()}{words[1:]}." for words in said]


def _lowered(words: str) -> str:
    return words[0].lower() + words[1:]


def _percent(share: float, decimals: int = 0) -> str:
    return f"{round(100 * share, decimals) + 0.0:.{decimals}f} %"  # + 0.0: no -0


def next_steps(result: Mapping[str, Any], all_open: bool = False) -> list[str]:
    """Returns sentences on what to do next, most useful first. all_open: lists all effects that a measurement would
    reveal, not just one and the number of the others."""
    steps, told = [], {name for own in result.get("sets", []) for name in own["effects"]}
    for advice in result["next_measurement"][:1]:
        left = [name for name in advice.get("separates", []) if name not in told]
        shown = left if all_open or len(left) < 3 else [left[0], f"{len(left) - 1} more"]
        steps.append(f"{f'Not told: {listed(shown)}. ' if left else ''}Measure: {advice['text']}.")
    # No name explains all: a rig or an albedo that is improbable may be part of what is missing.
    least = NUMBERS.strain if result["verdict"] == "unknown" else IMPOSSIBLE_SIGMAS
    for kind, again in (("geometry", "Calibrate the rig"), ("albedos", "Measure the albedos")):
        if any(entry.get("stated_sigmas", 0.0) > least for entry in result.get(kind, [])):
            steps.append(f'{again} again, or state a larger "uncertainty" in capture.json.')
    if result["verdict"] == "effect":
        families = {entry["effect"]: entry["family"] for entry in result["ranking"]}
        mend = [_REMEDIES.get(families.get(name, ""), "Mend the sensor and record again") for name in result["added"]]
        first, *others = dict.fromkeys(mend)
        remedies = "; ".join([first, *(_lowered(words) for words in others if words)])
        steps.append(f"{remedies}, or simulate with model.json, which has it.")
    elif result["verdict"] == "unknown":
        steps.insert(0, "Edit effect_stub.py, which holds a formula of what is left, and diagnose with it.")
    elif result["verdict"] == "none":
        steps.insert(0, "Simulate with model.json, which holds scales and noise.")
    return steps


def explained(result: Mapping[str, Any], effect_id: str) -> str:
    """Returns a sentence on why an effect was named, or why not."""
    skipped = {entry["effect"]: entry["reason"] for entry in result["not_ranked"]}
    if effect_id in skipped:
        return f"{effect_id} was not judged: {skipped[effect_id]}"
    entry = next((entry for entry in result["ranking"] if entry["effect"] == effect_id), None)
    if entry is None:
        return f"{effect_id} explains next to nothing of the images"
    gain = f"{effect_id} explains {_size(entry)}"
    if effect_id in result["added"]:
        others = ", ".join(entry["equivalent"])
        return f"{gain} and was named" + (f"; this recording cannot tell it from {others}" if others else "")
    first = result["ranking"][0]
    if first is entry:
        return f"{gain}, more than any other effect, and was not named: the verdict is '{result['verdict']}'"
    if effect_id in first["equivalent"]:
        return f"{gain}: this recording cannot tell it from {first['effect']}"
    return f"{gain}, {first['effect']} explains {_size(first)}"


def _size(entry: Mapping[str, Any]) -> str:
    """Returns an effect's gain as text: noise variances and nats, in measured rooms nats alone."""
    nats, gain = f"{entry['score_nats']:.0f} nats", entry["gain_reduced_chi2"]
    return nats if gain is None else f"{gain:.3g} noise variances ({nats})"


def ranking_figure(result: Mapping[str, Any]) -> Figure:
    """Returns a bar chart of the first effects' gains, largest first, in noise variances; in measured rooms in nats.
    Bars of named effects are coloured."""
    from matplotlib.figure import Figure

    entries = result["ranking"][:_BARS]
    key, unit = "gain_reduced_chi2", "noise variances"
    if any(entry[key] is None for entry in entries):
        key, unit = "score_nats", "nats"
    entries = sorted(entries, key=lambda entry: entry[key])
    figure = Figure(figsize=(6.4, 0.6 + 0.3 * max(len(entries), 1)), layout="constrained")
    axes = figure.subplots()
    colours = ["C0" if entry["effect"] in result["added"] else "0.8" for entry in entries]
    axes.barh([entry["effect"] for entry in entries], [entry[key] for entry in entries], color=colours)
    axes.set_xlabel(f"explained alone, {unit} (blue: named)")
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
