# SPDX-License-Identifier: Apache-2.0
"""Reads model.json, versions 1 and 2. An invalid file raises an error of one line with the file, the key and the
fault."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from activestereo.capture.capture import read_camera
from activestereo.capture.capture_json import JsonObject
from activestereo.common.limits import BITS, EXPOSURE, FOCAL, GAIN, LINE_TIME, POWER, SIDE
from activestereo.common.shown import unknown_effect
from activestereo.effects import builtin
from activestereo.effects.core.descriptor import Effect
from activestereo.effects.core.surfaces import SURFACES
from activestereo.model.model import (
    MATERIAL_FIELDS,
    NOISE_TERMS,
    NUISANCES,
    Imager,
    MeasuredPose,
    ModelEffect,
    Pattern,
    Quantity,
    Rig,
    SensorModel,
)

FORMAT = "active-stereo-model"
VERSION = 2
_WHAT_IT_IS = "; a model is a model.json, which diagnose, calibrate or add writes"
# The depth engine accepts no smaller images and no fewer bits.
_IMAGE_SIDE = replace(SIDE, low=32)
_BIT_DEPTH = replace(BITS, low=8)
# Keys that explain a file to its reader; they are written, and not read.
_NOTES = ("simulated", "image_only", "unit")


def read_model(path: str | Path, effects: dict[str, Effect] | None = None) -> SensorModel:
    """Reads a model file. effects: {id: Effect} that the file may name; None = the built-in ones. Raises ValueError
    with the fault."""
    root = JsonObject.read(path, _WHAT_IT_IS)
    root.check_format(FORMAT, _WHAT_IT_IS)
    version = root.integer("version")
    if not 1 <= version <= VERSION:
        root.fail("version", f"is {version}; this program reads versions 1 to {VERSION}")
    known = builtin() if effects is None else effects
    if version == 2:
        model = _read(root, known)
    else:  # effects with plain numbers, surfaces by number, and three nuisances without intervals
        nuisances = root.object("nuisances", optional=True)
        names = [name for name in nuisances.keys() if name in NUISANCES] if nuisances else []
        quantities = {name: Quantity(nuisances.number(name), unit=NUISANCES[name][0]) for name in names}
        model = SensorModel(effects=_effects(root, known), nuisances=quantities, source="a model file of version 1")
    for key in root.unknown_keys():
        if key.rsplit(".", 1)[-1] not in _NOTES:
            raise ValueError(f"{path}: {key}: this version knows no such key")
    return model


def _read(root: JsonObject, effects: dict[str, Effect]) -> SensorModel:
    rig, pattern = root.object("rig", optional=True), root.object("pattern", optional=True)
    imager, materials = root.object("imager", optional=True), root.object("materials", optional=True)
    nuisances = root.object("nuisances", optional=True)
    return SensorModel(
        rig=rig and _rig(rig),
        pattern=pattern and _pattern(pattern),
        imager=imager
        and Imager(**{name: _quantity(imager, name, unit, 0.0, np.inf) for name, unit in NOISE_TERMS.items()}),
        effects=_effects(root, effects),
        materials={name: _fields(materials.object(name), MATERIAL_FIELDS) for name in materials.keys()}
        if materials
        else {},
        nuisances=_fields(nuisances, NUISANCES) if nuisances else {},
        poses=tuple(
            MeasuredPose(entry.rigid_transform("stated"), entry.rigid_transform("measured"))
            for entry in (root.objects("poses") if root.has("poses") else [])
        ),
        source=_source(root),
    )


def _effects(root: JsonObject, effects: dict[str, Effect]) -> tuple[ModelEffect, ...]:
    found: list[ModelEffect] = []
    for entry in root.objects("effects") if root.has("effects") else []:
        name = entry.text("id")
        if name not in effects:
            entry.fail("id", unknown_effect(name, effects))
        if name in (e.effect.id for e in found):
            entry.fail("id", f"the effect '{name}' is there twice")
        entry.name = f"effects[{name}]"
        parameters = entry.object("parameters", optional=True)
        known = {p.name: p for p in effects[name].parameters}
        values: dict[str, Quantity] = {}
        for key in parameters.keys() if parameters else ():
            if key not in known:
                parameters.fail(key, f"{name} has no such parameter (known: {', '.join(known)})")
            values[key] = _quantity(parameters, key, known[key].unit, known[key].low, known[key].high)
        surfaces = tuple(entry.texts("surfaces")) if entry.has("surfaces") else ()
        if surfaces and SURFACES not in effects[name].parameters:
            entry.fail("surfaces", f"{name} is not an effect of surfaces")
        found.append(ModelEffect(effects[name], values, surfaces))
    return tuple(found)


def _fields(entry: JsonObject, known: dict[str, tuple[str, float, float]]) -> dict[str, Quantity]:
    for name in entry.keys():
        if name not in known:
            entry.fail(name, f"there is no such field (known: {', '.join(known)})")
    return {name: _quantity(entry, name, *known[name]) for name in entry.keys()}


def _quantity(entry: JsonObject, key: str, unit: str, low: float, high: float) -> Quantity:
    """Reads a number or an object of value, low, high and source. Raises CaptureError for a value outside low..high
    or its own interval."""
    plain = entry.plain(key)
    if not isinstance(plain, dict):
        value, ends, source = entry.number(key), (None, None), ""
    else:
        inner = entry.object(key)
        value, ends = inner.number("value"), (inner.number("low", optional=True), inner.number("high", optional=True))
        source = _source(inner)
    if not low <= value <= high:
        entry.fail(key, f"is {value:g} {unit}, outside {low:g}..{high:g}")
    rising = [number for number in (ends[0], value, ends[1]) if number is not None]
    if rising != sorted(rising):
        entry.fail(key, f"is {value:g} {unit}, outside of its interval, low = {ends[0]} to high = {ends[1]}")
    return Quantity(value, *ends, unit=unit, source=source)


def _source(entry: JsonObject) -> str:
    return entry.text("source") if entry.has("source") else ""


def _rig(entry: JsonObject) -> Rig:
    return Rig(
        left=read_camera(entry.object("left"), _IMAGE_SIDE, needs_lens=False),
        right=read_camera(entry.object("right"), _IMAGE_SIDE, needs_lens=False),
        left_to_right=entry.rigid_transform("left_to_right"),
        left_to_projector=entry.rigid_transform("left_to_projector") if entry.has("left_to_projector") else None,
        bit_depth=entry.integer("bit_depth", _BIT_DEPTH) if entry.has("bit_depth") else 8,
        line_time_s=entry.number("line_time_s", LINE_TIME, optional=True),
        exposure_s=entry.number("exposure_s", EXPOSURE, optional=True),
        gain=entry.number("gain", GAIN, optional=True),
        source=_source(entry),
    )


def _pattern(entry: JsonObject) -> Pattern:
    source, k = _source(entry), entry.camera_matrix("K")
    if not entry.has("dots"):
        return Pattern(k, file=entry.file("file"), source=source)
    size = entry.integer("width", SIDE), entry.integer("height", SIDE)
    sigma_px = entry.number("dot_sigma_px", FOCAL)
    background = entry.number("background", POWER) if entry.has("background") else 0.0
    return Pattern(
        k, dots=entry.table("dots", 3), size=size, dot_sigma_px=sigma_px, background=background, source=source
    )
