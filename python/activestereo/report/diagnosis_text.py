# SPDX-License-Identifier: Apache-2.0
"""A diagnosis for reading."""

from collections.abc import Mapping, Sequence
from typing import Any

_SHOWN = 8


def parameter_text(name: str, found: Mapping[str, Any]) -> str:
    """One parameter of a ranking's entry for reading: a choice by its materials, else value, interval and unit."""
    if "materials" in found:
        return f"on {', '.join(found['materials']) or 'all surfaces'}"
    interval = "" if found["low"] is None or found["high"] is None else f" ({found['low']:.4g} to {found['high']:.4g})"
    return f"{name} {found['value']:.4g}{interval}" + ("" if found["unit"] in ("", "1") else f" {found['unit']}")


def error_text(rmse_dn: float, floor_dn: float | None, decimals: int) -> str:
    """An error for reading. Nothing is below the noise floor but by chance: no digit of that is told."""
    return f"{rmse_dn:.{decimals}f} DN" if floor_dn is None or rmse_dn > floor_dn else "at the noise floor"


def diagnosis_text(result: Mapping[str, Any]) -> str:
    """The summary that the command prints."""
    lines = [f"verdict: {result['verdict']}" + (f" ({', '.join(result['added'])})" if result["added"] else "")]
    if result.get("reason"):
        lines.append(result["reason"])
    lines += _table(result["ranking"])
    first = result["ranking"][0] if result["ranking"] else None
    if first and first["equivalent"] and result["verdict"] in ("effect", "undetermined"):
        lines.append(f"this data cannot tell {first['effect']} from {', '.join(first['equivalent'])}")
    if result["heldout_ir_rmse_before"] is not None:
        floor = result["heldout_noise_floor"]
        before, after = (error_text(result[f"heldout_ir_rmse_{when}"], floor, 3) for when in ("before", "after"))
        noise = "unknown" if floor is None else f"{floor:.3f} DN"
        lines.append(f"held-out infrared RMSE: {before} before, {after} after, noise floor {noise}")
    lines += _depth_lines(result.get("depth"))
    lines += [f"next measurement: {advice['text']}" for advice in result["next_measurement"]]
    if result.get("law"):
        lines.append(f"law of the residual ({result['law']['stage']}): {result['law']['text']}")
    return "\n".join(lines)


def _table(ranking: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = (
        [f"{'effect':26}{'family':20}{'nats':>12}{'explains':>10}{'confidence':>12}  parameters (90 %)"]
        if ranking
        else []
    )
    for entry in ranking[:_SHOWN]:
        values = _values(entry)
        share, confidence = f"{100 * entry['explained_share']:.0f} %", f"{entry['confidence']:.2f}"
        lines.append(
            f"{entry['effect']:26}{entry['family']:20}{entry['score_nats']:>12.1f}{share:>10}{confidence:>12}  {values}"
        )
    return lines


def _values(entry: Mapping[str, Any]) -> str:
    return ", ".join(parameter_text(name, found) for name, found in entry["parameters"].items())


def _depth_lines(depth: Mapping[str, Any] | None) -> list[str]:
    """The verdict on the depth engine, and what differs from our engine as any other would."""
    if not depth:
        return []
    lines = [f"depth engine: {depth['verdict']}" + (f" ({depth['reason']})" if depth["reason"] else "")]
    for entry in depth["ranking"]:
        if entry["effect"] in depth["added"] or (entry["nuisance"] and entry["score_nats"] > 0):
            kind = "any matcher differs so" if entry["nuisance"] else "added"
            lines.append(
                f"  {entry['effect']}, {kind}: {_values(entry)}; {100 * entry['explained_share']:.0f} % of its error"
            )
    return lines
