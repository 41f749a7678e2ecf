# SPDX-License-Identifier: Apache-2.0
"""Reads libraries of effects, built in or from a user's file, and takes effects from and to sensor models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from activestereo.capture.capture_json import CaptureError, JsonObject
from activestereo.common.shown import unknown_effect
from activestereo.effects import Effect, Model, builtin, load_effects
from activestereo.effects.core.model import Nuisances
from activestereo.effects.core.surfaces import surface_names
from activestereo.model import Quantity, SensorModel, read_model
from activestereo.model.diagnosed import calibrated
from activestereo.model.model import with_surfaces

FORMAT = "active-stereo-model"


def library(*files: str | Path) -> dict[str, Effect]:
    """Returns {id: Effect}, the built-in effects and those of the files; a file's effect replaces a built-in one of the
    same id."""
    effects = builtin()
    for file in files:
        effects |= load_effects(file)
    return effects


def find(effects: dict[str, Effect], effect_id: str) -> Effect:
    """Returns the effect with this id. For an unknown id raises ValueError with the nearest one."""
    if effect_id not in effects:
        raise ValueError(unknown_effect(effect_id, effects))
    return effects[effect_id]


def read_models(
    path: str | Path, effects: dict[str, Effect], scene_path: str | Path | None = None
) -> tuple[SensorModel, Model]:
    """Reads a model file; returns all of it, and its effects. scene_path: the scene whose surfaces the file may name.
    Raises ValueError with the fault."""
    stated, names = read_model(path, effects), surface_names(scene_path)
    try:
        return stated, stated.bound(names)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def scene_of(capture_path: str | Path) -> Path | None:
    """Returns the scene file of a capture folder; None if its capture.json does not name one (read_capture explains
    why)."""
    folder = Path(capture_path)
    file = folder if folder.name == "capture.json" else folder / "capture.json"
    try:
        return cast(Path, JsonObject.read(file).file("scene"))
    except CaptureError:
        return None


def model_json(model: Model, nuisances: Nuisances | None = None) -> dict[str, Any]:
    """Returns a model's effects and nuisances in plain numbers, as in diagnose.json."""
    effects = [{"id": e.id, "parameters": dict(values)} for e, values in model.effects]
    return {"format": FORMAT, "version": 1, "effects": effects, "nuisances": vars(nuisances) if nuisances else {}}


def compared_under(model: SensorModel, capture_path: str | Path) -> dict[str, Any]:
    """Returns compare()'s arguments for a sensor model: its effects on the capture's surfaces, its calibration, and its
    scene measurement."""
    names = surface_names(scene_of(capture_path))
    return {
        "model": model.bound(names),
        "calibrate": lambda capture: calibrated(capture, model),
        "scene_measurement": model.scene_measurement(names),
    }


def with_effects_of(base: SensorModel, model: Model, scene_path: str | Path | None) -> SensorModel:
    """Returns `base` with the effects of `model` in place of its own; an effect of equal values keeps its intervals.
    scene_path: the scene whose surfaces it names."""
    names, out = surface_names(scene_path), replace(base, effects=())
    for effect, values in model.effects:
        units = {p.name: p.unit for p in effect.parameters}
        plain, surfaces = with_surfaces(effect, values, names)
        known: Mapping[str, Quantity] = next((e.parameters for e in base.effects if e.effect.id == effect.id), {})
        quantities = {
            name: known[name] if name in known and known[name].value == value else Quantity(value, unit=units[name])
            for name, value in plain.items()
        }
        out = out.with_effect(effect, quantities, surfaces)
    return out
