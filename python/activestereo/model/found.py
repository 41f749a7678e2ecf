# SPDX-License-Identifier: Apache-2.0
"""The finding of a diagnose.json for an effect."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from activestereo.effects.core.surfaces import SURFACES
from activestereo.model.model import Quantity


def found_effect(diagnosis: Mapping[str, Any], effect_id: str) -> tuple[dict[str, Quantity], tuple[str, ...]]:
    """({parameter: Quantity}, names of the surfaces that show it, () = all): as accepted into the model, else as
    ranked."""
    accepted = [(e.get("id"), e) for e in diagnosis.get("model", {}).get("effects", [])]
    ranked = {e.get("effect"): e for e in diagnosis.get("ranking", [])}
    for name, entry in [*accepted, *ranked.items()]:
        if name == effect_id:
            return _quantities(
                entry["parameters"], ranked.get(effect_id, {}).get("parameters", {}), entry.get("surfaces")
            )
    raise ValueError(f"the diagnosis has no parameters of '{effect_id}'")


def _quantities(
    values: Mapping[str, Any], ranked: Mapping[str, Any], surfaces: list[str] | None
) -> tuple[dict[str, Quantity], tuple[str, ...]]:
    out = {}
    for name, value in values.items():
        if name != SURFACES.name:
            entry = value if isinstance(value, Mapping) else {"value": value}
            out[name] = Quantity(
                entry["value"], entry.get("low"), entry.get("high"), entry.get("unit", "1"), "diagnosis"
            )
    named = surfaces if surfaces is not None else ranked.get(SURFACES.name, {}).get("materials", [])
    return out, tuple(named)
