# SPDX-License-Identifier: Apache-2.0
"""Defines the page's sliders: their ranges and first positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from activestereo.common.shown import without_unit
from activestereo.effects import Effect
from activestereo.effects.core.surfaces import SURFACES
from activestereo.model import SensorModel
from activestereo.model.model import MATERIAL_FIELDS
from activestereo.report.view.settings import SURFACE_FIELDS
from activestereo.report.view.simulation import Exposure

# A camera's slider spans this factor below and above its first position.
_REACH = 16.0
# An effect's slider reaches so many prior deviations from neutral; its field takes all that is possible.
_DEVIATIONS = 5.0


@dataclass(frozen=True)
class Slider:
    """A slider of one number. least, most: limits of typed numbers; low, high: the slider's ends; is_log: equal steps
    are equal ratios."""

    name: str
    label: str
    unit: str
    value: float
    low: float
    high: float
    least: float
    most: float
    is_log: bool = False

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def camera_sliders(exposure: Exposure) -> list[Slider]:
    """Returns the sliders of exposure, gain and laser power. Their values are the configuration's; under automatic
    exposure the picture itself states exposure and gain."""
    config = exposure.config
    exposure_s, gain = config.ir_camera_exposure, config.ir_camera_gain
    power, (_, strongest, _) = config.laser_power_mw, config.laser_power_limits_mw
    return [
        _ratio("exposure_s", "exposure", "s", exposure_s),
        _ratio("gain", "gain", "", gain),
        Slider("laser_power_mw", "laser power", "mW", power, 0.0, strongest, 0.0, strongest),
    ]


def surface_sliders(values: Mapping[str, float]) -> list[Slider]:
    """Returns a slider for each property of a surface, from 0 to 1. values: {one of SURFACE_FIELDS: its value}."""
    out = []
    for name in SURFACE_FIELDS:
        unit, low, high = MATERIAL_FIELDS[name]
        label = name.replace("ir_", "infrared ")
        out.append(Slider(name, label, "" if unit == "1" else unit, values[name], low, high, low, high))
    return out


def effect_sliders(effect: Effect) -> list[Slider]:
    """Returns a slider for each numeric parameter of an effect, at its typical value."""
    out = []
    for p in effect.parameters:
        if p.name != SURFACES.name:
            reach, unit = _DEVIATIONS * p.typical, "" if p.unit == "1" else p.unit
            low, high = max(p.low, p.neutral - reach), min(p.high, p.neutral + reach)
            label = without_unit(p.name, unit).replace("_", " ")
            out.append(Slider(p.name, label, unit, p.typical_value, low, high, p.low, p.high))
    return out


def catalogue(effects: Mapping[str, Effect]) -> list[dict[str, Any]]:
    """Returns every effect that the page can add, with its summary and sliders, for JSON."""
    return [
        {
            "id": effect.id, "family": effect.family,
            "summary": " ".join(effect.summary.split()).partition(". ")[0].removesuffix(".") + ".",
            "on_surfaces": SURFACES in effect.parameters,
            "sliders": [slider.as_json() for slider in effect_sliders(effect)],
        }
        for effect in effects.values()
    ]  # fmt: skip


def present_effects(model: SensorModel) -> dict[str, dict[str, Any]]:
    """Returns the model's effects as {id: {parameter: value}}, the form of the page's settings."""
    out: dict[str, dict[str, Any]] = {}
    for entry in model.effects:
        out[entry.effect.id] = {name: q.value for name, q in entry.parameters.items()}
        if entry.surfaces:
            out[entry.effect.id][SURFACES.name] = list(entry.surfaces)
    return out


def _ratio(name: str, label: str, unit: str, value: float) -> Slider:
    low, high = value / _REACH, value * _REACH
    return Slider(name, label, unit, value, low, high, low, high, is_log=True)
