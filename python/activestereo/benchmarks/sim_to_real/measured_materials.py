# SPDX-License-Identifier: Apache-2.0
"""What `acquire` found of the foreign world, in place of what the simulation has: the objects' materials, the imager's
noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from activestereo.benchmarks.sim_to_real.objects import GapObject
from activestereo.benchmarks.sim_to_real.stage import NoiseLaw
from activestereo.effects.engines.world import copy_record
from activestereo.model import read_model

Acquired = Mapping[str, Mapping[str, float]]  # {object: {field of its material: value}}


def read_acquired(path: Path, objects: tuple[GapObject, ...]) -> Acquired:
    """Of a model.json whose materials are called as the objects are. ValueError where it has none of these."""
    names = [thing.name for thing in objects]
    known = read_model(path).survey(names).surfaces
    if not known:
        raise ValueError(f"{path}: has a material of none of the objects ({', '.join(names)})")
    return {names[number]: dict(fields) for number, fields in sorted(known.items())}


def read_imager(path: Path) -> NoiseLaw:
    """Of a model.json. ValueError where it has no imager."""
    imager = read_model(path).imager
    if imager is None:
        raise ValueError(f"{path}: has no imager: 'activestereo acquire noise' makes one")
    return NoiseLaw(imager.offset.value, imager.shot.value, imager.relative.value)


def with_acquired(objects: tuple[GapObject, ...], acquired: Acquired) -> tuple[GapObject, ...]:
    """What was not found stays."""
    return tuple(_changed(thing, acquired.get(thing.name, {})) for thing in objects)


def _changed(thing: GapObject, fields: Mapping[str, float]) -> GapObject:
    material = copy_record(thing.material)
    for name, value in fields.items():
        setattr(material, name, value)
    return replace(thing, material=material)
