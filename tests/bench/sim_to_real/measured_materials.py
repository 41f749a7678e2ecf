# SPDX-License-Identifier: Apache-2.0
"""Values that `calibrate` found in the foreign world, in place of the simulation's own: the objects' materials, the
imager's noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from sim_to_real.objects import BenchmarkObject
from sim_to_real.stage import NoiseModel
from activestereo.effects.engines.world import copy_record
from activestereo.model import read_model

Measured = Mapping[str, Mapping[str, float]]  # {object: {field of its material: value}}


def read_measured(path: Path, objects: tuple[BenchmarkObject, ...]) -> Measured:
    """Reads the materials of a model.json that are named after objects. Raises ValueError if it has none."""
    names = [thing.name for thing in objects]
    known = read_model(path).scene_measurement(names).surfaces
    if not known:
        raise ValueError(f"{path}: has a material of none of the objects ({', '.join(names)})")
    return {names[number]: dict(fields) for number, fields in sorted(known.items())}


def read_imager(path: Path) -> NoiseModel:
    """Reads the imager of a model.json. Raises ValueError if it has none."""
    imager = read_model(path).imager
    if imager is None:
        raise ValueError(f"{path}: has no imager: 'activestereo calibrate noise' makes one")
    return NoiseModel(imager.offset.value, imager.shot.value, imager.relative.value)


def with_measured(objects: tuple[BenchmarkObject, ...], measured: Measured) -> tuple[BenchmarkObject, ...]:
    """The scene with the measured materials; those that were not found stay."""
    return tuple(_changed(thing, measured.get(thing.name, {})) for thing in objects)


def _changed(thing: BenchmarkObject, fields: Mapping[str, float]) -> BenchmarkObject:
    material = copy_record(thing.material)
    for name, value in fields.items():
        setattr(material, name, value)
    return replace(thing, material=material)
