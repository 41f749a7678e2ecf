# SPDX-License-Identifier: Apache-2.0
"""Compares what `calibrate materials` finds of the objects of bench_sim_to_real.py as the foreign world of Mitsuba 3
has them.

    pip install mitsuba     # 3.9 was tried
    PYTHONPATH=build/python:tests/python/shared python3 tests/bench/bench_sim_to_real_materials.py --out out/materials
    python3 tests/bench/bench_sim_to_real.py ablate out/gap --measured out/materials/model.json

Mitsuba records two poses of each object with its own materials; the scene says what the simulation has. An object's
result is a file of its own, so that processes, each with --only, share a machine; each then writes model.json of what
there is. A table of what was found beside what the simulation has is printed.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from material_worlds import record
from material_worlds_mitsuba import MitsubaWorld

from activestereo.calibrate.materials import calibrate_materials
from sim_to_real.foreign_mitsuba import foreign_bsdf
from sim_to_real.objects import objects
from activestereo.model import SensorModel, read_model
from activestereo.model.write import write_model

FIELDS = ("roughness", "metallic", "specular", "transmission", "ir_albedo")


def measured(index: int, spp: int) -> SensorModel:
    """Called as the object is; without what the pictures do not determine."""
    thing = objects()[index]
    place = np.array([[1.0, 0, 0, 0], [0, 0, 1, thing.rest_m], [0, -1, 0, 0], [0, 0, 0, 1]])
    told = thing.material
    world = MitsubaWorld(thing.mesh, place, lambda _, camera_m: foreign_bsdf(thing.mesh, told, index, camera_m), spp)
    albedo = float(told.base_color[0])
    nominal = tuple(float(getattr(told, name)) for name in FIELDS[:-1]) + (albedo,)
    with tempfile.TemporaryDirectory() as folder:
        path = record(
            Path(folder), nominal, nominal, shape="thing", color=(albedo,) * 3, nominal_color=(albedo,) * 3,
            see=world.see, thing=(thing.mesh, place),
        )  # fmt: skip
        found = calibrate_materials(path, "thing")
    (fields,) = found.found.values()
    return SensorModel(materials={thing.name: fields})


def table(models: dict[str, SensorModel]) -> list[str]:
    lines = ["| object | " + " | ".join(FIELDS) + " |", "|--|" + "--|" * len(FIELDS)]
    for thing in objects():
        fields: Any = models[thing.name].materials.get(thing.name, {}) if thing.name in models else {}
        nominal = [getattr(thing.material, name) for name in FIELDS[:-1]] + [thing.material.base_color[0]]
        told = [
            f"{own:g}: {fields[name].value:.2f}" if name in fields else f"{own:g}: open"
            for name, own in zip(FIELDS, nominal)
        ]
        lines.append(f"| {thing.name} | {' | '.join(told)} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [thing.name for thing in objects()]
    parser.add_argument("--only", nargs="*", default=names, choices=names, metavar="NAME")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for name in args.only:
        path = args.out / f"{name}.json"
        if not path.exists():
            write_model(path, measured(names.index(name), args.spp))
    models = {name: read_model(args.out / f"{name}.json") for name in names if (args.out / f"{name}.json").exists()}
    materials = {name: fields for model in models.values() for name, fields in model.materials.items()}
    write_model(args.out / "model.json", SensorModel(materials=materials))
    print("\n".join(table(models)))


if __name__ == "__main__":
    main()
