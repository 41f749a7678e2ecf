# SPDX-License-Identifier: Apache-2.0
"""Defines the page's sliders, their ranges and first positions: exposure, gain, laser power, surfaces, effects. Parses
the page's settings and applies them. A setting whose slider was not moved is absent, and its value stays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from activestereo.camera.plan import remove_noise
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.limits import ANY, EXPOSURE, GAIN, Limits
from activestereo.common.shown import require_known, unknown, without_unit
from activestereo.effects import Effect
from activestereo.effects.core.surfaces import SURFACES
from activestereo.model import Quantity, SensorModel
from activestereo.model.model import MATERIAL_FIELDS

# Surface properties that have a slider, in the sliders' order.
SURFACE_FIELDS = ("roughness", "ir_albedo", "specular", "metallic", "transmission")
_CAMERA = {"exposure_s": EXPOSURE, "gain": GAIN, "laser_power_mw": Limits(0.0, 1e9, "mW")}
_KEYS = (*_CAMERA, "has_noise", "materials", "effects")
BY_HAND = "set by hand in activestereo view"
# A camera's slider spans this factor below and above its first position.
_REACH = 16.0
# An effect's slider spans so many standard deviations of the prior around neutral; its number field takes all values.
_DEVIATIONS = 5.0


@dataclass(frozen=True)
class Settings:
    """The page's settings. exposure_s, gain, laser_power_mw: None for the sensor's own. materials: {name: {one of
    SURFACE_FIELDS: value}}.

    effects: {id: {parameter: value}} of all active effects, None for the model's. surfaces: {effect id: names of the
    materials that it acts on}; an absent effect acts on all. library: {id: Effect} of the effects that may be active.
    """

    exposure_s: float | None = None
    gain: float | None = None
    laser_power_mw: float | None = None
    has_noise: bool = True
    materials: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    effects: Mapping[str, Mapping[str, float]] | None = None
    surfaces: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    library: Mapping[str, Effect] = field(default_factory=dict, repr=False)

    def applied(
        self, config: StereoDepthSensorConfig, model: SensorModel
    ) -> tuple[StereoDepthSensorConfig, SensorModel]:
        """Returns (configuration, model) under these settings. The argument `config` is changed in place. Raises
        ValueError for a laser power outside of the laser's limits."""
        if self.exposure_s is not None or self.gain is not None:
            config.ir_exposure_mode = "fixed"
        if self.exposure_s is not None:
            config.ir_camera_exposure = self.exposure_s
        if self.gain is not None:
            config.ir_camera_gain = self.gain
        if self.laser_power_mw is not None:
            config.laser_power_mw = self.laser_power_mw
            config.check()  # raises ValueError for a power outside of the laser's limits
        if not self.has_noise:
            remove_noise(config)
        return config, self.in_model(model)

    def in_model(self, model: SensorModel) -> SensorModel:
        """Returns the model with these settings' effects and surface values. If `effects` is None the model keeps its
        own effects."""
        known = {entry.effect.id: entry for entry in model.effects}
        if self.effects is not None:
            model = replace(model, effects=())
        for name, values in (self.effects or {}).items():
            effect, on = self.library[name], self.surfaces.get(name, ())
            entry = known.get(name)
            if entry is not None and entry.surfaces == on:
                stated = effect.values({n: q.value for n, q in entry.parameters.items()})
                if all(stated[n] == value for n, value in values.items()):  # keep intervals and sources
                    model = replace(model, effects=(*model.effects, entry))
                    continue
            units = {p.name: p.unit for p in effect.parameters}
            quantities = {n: Quantity(v, unit=units[n], source=BY_HAND) for n, v in values.items()}
            model = model.with_effect(effect, quantities, on)
        materials = {name: dict(fields) for name, fields in model.materials.items()}
        for name, values in self.materials.items():
            own = materials.setdefault(name, {})
            own |= {f: Quantity(v, unit=MATERIAL_FIELDS[f][0], source=BY_HAND) for f, v in values.items()}
        return replace(model, materials=materials)


def settings_of(given: Any, library: Mapping[str, Effect], material_names: list[str]) -> Settings:
    """Parses the settings in a call's JSON object. library: {id: Effect} and material_names: what the settings may
    name. Raises ValueError with the fault."""
    given = _object(given, "settings")
    require_known("setting", given, _KEYS)
    moved = {name: limits for name, limits in _CAMERA.items() if given.get(name) is not None}
    camera = {name: float(limits.check(name, given[name])) for name, limits in moved.items()}
    touched = _object(given.get("materials", {}), "materials")
    materials = {name: _surface(name, values, material_names) for name, values in touched.items()}
    effects: dict[str, dict[str, float]] = {}
    surfaces = {}
    for name, values in _object(given.get("effects", {}), "effects").items():
        if name not in library:
            raise ValueError(unknown("effect", name, library))
        values = dict(_object(values, name))
        if SURFACES.name in values:
            on = values.pop(SURFACES.name)
            if not isinstance(on, list) or not all(one in material_names for one in on):
                raise ValueError(f"{name}.{SURFACES.name} is {on!r}, expected a list of {', '.join(material_names)}")
            surfaces[name] = tuple(on)
        numbers = {n: float(ANY.check(f"{name}.{n}", v)) for n, v in values.items()}
        checked = library[name].values(numbers)
        effects[name] = {n: v for n, v in checked.items() if n != SURFACES.name}
    has_noise = given.get("has_noise", True)
    if not isinstance(has_noise, bool):
        raise ValueError(f"has_noise is {has_noise!r}, expected true or false")
    return Settings(
        **camera, has_noise=has_noise, materials=materials, effects=effects if "effects" in given else None,
        surfaces=surfaces, library=library,
    )  # fmt: skip


def _surface(name: str, values: Any, material_names: list[str]) -> dict[str, float]:
    if name not in material_names:
        raise ValueError(unknown("material", name, material_names))
    out = {}
    for key, value in _object(values, name).items():
        if key not in SURFACE_FIELDS:
            raise ValueError(unknown("property of a surface", key, SURFACE_FIELDS))
        _, low, high = MATERIAL_FIELDS[key]
        out[key] = float(Limits(low, high).check(f"{name}.{key}", value))
    return out


def _object(value: Any, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} is {value!r}, expected a JSON object")
    return value


def _slider(
    name: str, label: str, unit: str, value: float, low: float, high: float, least: float, most: float,
    is_log: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Describes a slider of one number for the page. low, high: the slider's ends. least, most: limits of a number that
    is typed beside it. is_log: equal steps of the slider are equal ratios."""
    return {
        "name": name, "label": label, "unit": "" if unit == "1" else unit, "value": value, "low": low, "high": high,
        "least": least, "most": most, "is_log": is_log,
    }  # fmt: skip


def camera_sliders(config: StereoDepthSensorConfig) -> list[dict[str, Any]]:
    """Returns the sliders of exposure, gain and laser power. Their values are the configuration's; under automatic
    exposure the picture itself states exposure and gain."""
    ratios = (("exposure_s", "exposure", "s", config.ir_camera_exposure), ("gain", "gain", "", config.ir_camera_gain))
    out = []
    for name, label, unit, value in ratios:
        low, high = value / _REACH, value * _REACH
        out.append(_slider(name, label, unit, value, low, high, low, high, is_log=True))
    power, (_, most, _) = config.laser_power_mw, config.laser_power_limits_mw
    return [*out, _slider("laser_power_mw", "laser power", "mW", power, 0.0, most, 0.0, most)]


def surface_sliders(values: Mapping[str, float]) -> list[dict[str, Any]]:
    """Returns a slider for each property of a surface, over its range. values: {one of SURFACE_FIELDS: its value}."""
    out = []
    for name in SURFACE_FIELDS:
        unit, low, high = MATERIAL_FIELDS[name]
        out.append(_slider(name, name.replace("ir_", "infrared "), unit, values[name], low, high, low, high))
    return out


def catalogue(effects: Mapping[str, Effect]) -> list[dict[str, Any]]:
    """Returns every effect that the page can add, with its summary and a slider for each numeric parameter, at its
    typical value, for JSON."""
    out = []
    for effect in effects.values():
        sliders = []
        for p in effect.parameters:
            if p.name != SURFACES.name:
                reach = _DEVIATIONS * p.typical
                low, high = max(p.low, p.neutral - reach), min(p.high, p.neutral + reach)
                label = without_unit(p.name, p.unit).replace("_", " ")
                sliders.append(_slider(p.name, label, p.unit, p.typical_value, low, high, p.low, p.high))
        summary = " ".join(effect.summary.split()).partition(". ")[0].removesuffix(".") + "."
        named = {"id": effect.id, "family": effect.family, "summary": summary}
        out.append(named | {"on_surfaces": SURFACES in effect.parameters, "sliders": sliders})
    return out


def present_effects(model: SensorModel) -> dict[str, dict[str, Any]]:
    """Returns the model's effects as {id: {parameter: value}}, the form of the page's settings."""
    out: dict[str, dict[str, Any]] = {}
    for entry in model.effects:
        out[entry.effect.id] = {name: q.value for name, q in entry.parameters.items()}
        if entry.surfaces:
            out[entry.effect.id][SURFACES.name] = list(entry.surfaces)
    return out
