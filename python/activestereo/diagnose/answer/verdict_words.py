# SPDX-License-Identifier: Apache-2.0
"""The verdict of a diagnosis in a sentence, what it rests on in a few lines, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# Beyond noise less than this share of the noise variance is no error whose fall could be told.
_LEAST_EXCESS = 0.02
# A stated uncertainty that a correction exceeds by so much was stated wrong.
IMPOSSIBLE_SIGMAS = 10.0
# What to do where an effect of a family was found; where it is none of these, the sensor is what differs.
_REMEDIES = {
    "surface": "Give the scene file's materials the values found",
    "ambient light": "Give the scene file the light found, or shade the scene and record again",
    "second projector": "Switch the second projector off and record again",
    "medium": "Clear the air and record again",
    "motion": "Hold the rig and the scene still and record again",
    "camera geometry": "Calibrate the cameras again",
}


def beyond_stated(sigmas: float) -> str:
    """A clause for what the stated uncertainty makes impossible."""
    return f", {sigmas:.0f} times its stated uncertainty" if sigmas > IMPOSSIBLE_SIGMAS else ""


def error_text(rmse_dn: float, floor_dn: float | None, decimals: int) -> str:
    """An error for reading. Nothing is below the noise floor but by chance: no digit of that is told."""
    return f"{rmse_dn:.{decimals}f} DN" if floor_dn is None or rmse_dn > floor_dn else "at the noise floor"


def errors_told(result: Mapping[str, Any]) -> list[tuple[str, float]]:
    """(name, root mean square of the held-out frames in DN) of the models between which the verdict's share of the
    squared error goes, and of the one with the geometry as it was measured where that is another; else nothing."""
    before, after = result["heldout_ir_rmse_before"], result["heldout_ir_rmse_after"]
    if before is None or after is None:
        return []
    standing = result.get("heldout_ir_rmse_geometry", before)
    measured = [] if standing == before else [("geometry as measured", standing)]
    last = "with what was found" if result["added"] else "with its own scales"
    return [("held-out RMSE before", before), *measured, (last, after)]


def share_gone(result: Mapping[str, Any]) -> float | None:
    """The share of the held-out squared error beyond noise that goes with what was added, the geometry as it was
    measured; None where it cannot be told."""
    before, after, floor = (
        result[key] for key in ("heldout_ir_rmse_before", "heldout_ir_rmse_after", "heldout_noise_floor")
    )
    before = result.get("heldout_ir_rmse_geometry", before)
    if before is None or after is None or floor is None or before**2 < (1.0 + _LEAST_EXCESS) * floor**2:
        return None
    return 1.0 - max(after**2 - floor**2, 0.0) / (before**2 - floor**2)


def finding_words(result: Mapping[str, Any], effect_id: str) -> str:
    """The meaning of an effect that was found: its own sentence, else one with its id."""
    entries = [*result["ranking"], *(result.get("depth") or {}).get("ranking", [])]
    own = next((entry.get("finding") for entry in entries if entry["effect"] == effect_id), None)
    return own or f"The model lacks {effect_id}"


def rivals(result: Mapping[str, Any]) -> list[str]:
    """Ids of the effects that the data cannot tell from the first one."""
    if not result["ranking"] or result["verdict"] not in ("effect", "undetermined"):
        return []
    return alike(result, result["ranking"][0])


def alike(result: Mapping[str, Any], entry: Mapping[str, Any]) -> list[str]:
    """Ids that a row of the ranking cannot be told from. What explains far more than a row is as good as it, too, but
    not the other way round: beyond the first row both must say so."""
    own = entry["effect"]
    says = {other["effect"]: other["equivalent"] for other in result["ranking"]}
    is_first = result["ranking"][0]["effect"] == own
    return [x for x in entry["equivalent"] if x != own and (is_first or own in says.get(x, [own]))]


def headline(result: Mapping[str, Any]) -> str:
    """The verdict in one sentence."""
    left = _left(result)
    if result["verdict"] == "effect":
        found = [finding_words(result, name) for name in result["added"]]
        said = " and ".join([*found[:1], *map(_lowered, found[1:])])
        gone = share_gone(result)
        if gone is None or gone <= 0.0:
            return f"{said}."
        return f"{said}: {100 * gone:.0f} % of the squared error beyond noise goes."
    if result["verdict"] == "unknown":
        return f"Something is missing that no known effect explains{left}."
    if result["verdict"] == "none":
        engine = (result.get("depth") or {}).get("added", [])
        if engine:
            return f"The images lack nothing; in the depth: {_lowered(finding_words(result, engine[0]))}."
        return f"Nothing is missing: the model is at the noise floor{left}."
    reason = f": {result['reason']}" if result.get("reason") else ""
    return f"This data cannot tell what is missing{reason}."


def geometry_words(result: Mapping[str, Any]) -> list[str]:
    """Sentences on what stands elsewhere or reflects something else than the capture says, several views in one."""
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


def _left(result: Mapping[str, Any]) -> str:
    error, floor = result["heldout_ir_rmse_after"], result["heldout_noise_floor"]
    if error is None or floor is None:
        return ""
    return f" ({error_text(error, floor, 2)}, noise alone gives {floor:.2f} DN)"


def next_steps(result: Mapping[str, Any]) -> list[str]:
    """Sentences on what to do with the answer, most useful first."""
    steps = [_measurement(advice) for advice in result["next_measurement"][:1]]
    for kind, again in (("geometry", "Calibrate the rig"), ("albedos", "Measure the albedos")):
        if any(entry.get("stated_sigmas", 0.0) > IMPOSSIBLE_SIGMAS for entry in result.get(kind, [])):
            steps.append(f'{again} again, or state a larger "uncertainty" in capture.json.')
    if result["verdict"] == "effect":
        steps.append(f"{_remedies(result)}, or simulate with it: activestereo simulate --model model.json.")
    elif result["verdict"] == "unknown":
        steps.insert(0, "Edit effect_stub.py, which holds a formula of what is left, and add --effects effect_stub.py.")
    elif result["verdict"] == "none":
        steps.insert(0, "Simulate with model.json, which holds scales and noise: activestereo simulate --model FILE.")
    return steps


def _remedies(result: Mapping[str, Any]) -> str:
    """Advice to mend what differs where it is: in the scene, the calibration or the sensor."""
    families = {entry["effect"]: entry["family"] for entry in result["ranking"]}
    said = [_REMEDIES.get(families.get(name, ""), "Mend the sensor and record again") for name in result["added"]]
    return "; ".join([*said[:1], *(_lowered(words) for words in dict.fromkeys(said[1:]) if words != said[0])])


def _measurement(advice: Any) -> str:
    return f"Measure: {advice if isinstance(advice, str) else advice['text']}."
