# SPDX-License-Identifier: Apache-2.0
"""Writes model.json, version 2. A file is written whole or not at all."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.capture.capture_json import JsonObject
from activestereo.common.input_files import open_file, read_json_object
from activestereo.common.output_files import flat, replace_file, write_json
from activestereo.model.model import MATERIAL_FIELDS, NOISE_TERMS, NUISANCES, Quantity, SensorModel
from activestereo.model.read import FORMAT, VERSION


def write_model(path: str | Path, model: SensorModel) -> list[Path]:
    """Writes the model and, beside it, a copy of the pattern's image, PATH's stem with .pattern.png. Returns the
    written paths. Raises OSError."""
    path = Path(path)
    written = []
    pattern_name = f"{path.stem}.pattern.png"
    if model.pattern is not None and model.pattern.file is not None:
        source, copy = Path(model.pattern.file), path.with_name(pattern_name)
        if source.resolve() != copy.resolve():
            with open_file(source) as image:
                replace_file(copy, lambda file: shutil.copyfileobj(image, file))
        written.append(copy)
    write_json(path, model_json(model, pattern_name))
    return [path, *written]


def replace_sections(path: Path, measured: SensorModel, keep_rig: bool = False) -> None:
    """Replaces sections of a model file and keeps all others, even those that this program cannot read.

    Writes the rig, pattern, imager, effects, nuisances and materials of `measured` into the file at `path`, which is
    made if it does not exist. Effects, nuisances and materials replace only those of the same names. keep_rig: in a rig
    that is there already, only left_to_projector is replaced. Raises as stored_sections(), and then writes nothing."""
    new, root = model_json(measured), stored_sections(path)
    if keep_rig and root.get("rig") and "rig" in new:
        new["rig"] = root["rig"] | {"left_to_projector": new["rig"]["left_to_projector"]}
    root |= {name: new[name] for name in ("rig", "pattern", "imager") if name in new}
    if new["effects"]:
        names = {effect["id"] for effect in new["effects"]}
        kept = [effect for effect in root.get("effects") or [] if effect.get("id") not in names]
        root["effects"] = kept + new["effects"]
    if new.get("materials"):
        root["materials"] = (root.get("materials") or {}) | new["materials"]
    if new["nuisances"]:
        root["nuisances"] = (root.get("nuisances") or {}) | new["nuisances"]
    write_json(path, root, allow_nan=False)


def stored_sections(path: Path) -> dict[str, Any]:
    """Reads the file whose sections replace_sections() replaces; an empty model if it does not exist. Raises ValueError
    with the file if it is no model, has another version or a section of a wrong type."""
    if not path.exists():
        return {"format": FORMAT, "version": VERSION}
    try:
        root = read_json_object(path)
    except ValueError as error:
        raise ValueError(f"{error}: give another file to -o") from error
    if root.get("format") != FORMAT:
        raise ValueError(f"{path}: format is not {FORMAT!r}: give another file to -o")
    if root.get("version") != VERSION:
        told = f"version is {root.get('version')}, sections are written into version {VERSION}"
        raise ValueError(f"{path}: {told}: give another file to -o")
    sections = JsonObject(path, "", root)
    for name in ("rig", "pattern", "imager", "materials", "nuisances"):
        sections.object(name, optional=True)
    if sections.has("effects"):
        sections.objects("effects")
    return root


def model_json(model: SensorModel, pattern_file: str | None = None) -> dict[str, Any]:
    """Returns the content of model.json. pattern_file: name of the pattern's image in the same folder; None: the path
    in model.pattern. Each section says whether the engines simulate it."""
    root: dict[str, Any] = {"format": FORMAT, "version": VERSION, **_source(model.source)}
    if (rig := model.rig) is not None:
        root["rig"] = {"left": rig.left.as_json(), "right": rig.right.as_json()}
        root["rig"]["left_to_right"] = flat(rig.left_to_right)
        if rig.left_to_projector is not None:
            root["rig"]["left_to_projector"] = flat(rig.left_to_projector)
        root["rig"] |= {name: getattr(rig, name) for name in ("bit_depth", "line_time_s", "exposure_s", "gain")}
        root["rig"] |= _source(rig.source) | {"simulated": "engine"}
    if (pattern := model.pattern) is not None:
        root["pattern"] = {"K": flat(pattern.K)}
        if pattern.dots is None:
            root["pattern"]["file"] = pattern_file or str(pattern.file)
        else:
            width, height = pattern.size or (0, 0)
            root["pattern"] |= {"width": width, "height": height, "dot_sigma_px": pattern.dot_sigma_px}
            root["pattern"] |= {"background": pattern.background, "dots": np.asarray(pattern.dots).tolist()}
        root["pattern"] |= _source(pattern.source) | {"simulated": "engine"}
    if model.imager is not None:
        root["imager"] = {name: _quantity(getattr(model.imager, name), 0.0, np.inf) for name in NOISE_TERMS}
        root["imager"]["simulated"] = "engine"
    root["effects"] = []
    for entry in model.effects:
        effect, limits = entry.effect, {p.name: (p.low, p.high) for p in entry.effect.parameters}
        values = {name: _quantity(q, *limits[name]) for name, q in entry.parameters.items()}
        out: dict[str, Any] = {"id": effect.id, "parameters": values}
        if entry.surfaces:
            out["surfaces"] = list(entry.surfaces)
        out["simulated"] = "image" if effect.engine is None else "engine"
        if effect.engine is None:
            out["image_only"] = effect.image_only or "it brings no engine fields"
        root["effects"].append(out)
    root["materials"] = {
        name: {field: _quantity(q, *MATERIAL_FIELDS[field][1:]) for field, q in fields.items()}
        for name, fields in model.materials.items()
    }
    root["nuisances"] = {name: _quantity(q, *NUISANCES[name][1:]) for name, q in model.nuisances.items()}
    if model.poses:
        root["poses"] = [{"stated": flat(p.stated), "measured": flat(p.measured)} for p in model.poses]
    return root


def _quantity(q: Quantity, low: float, high: float) -> dict[str, Any]:
    """Returns a quantity's JSON. Its interval, often a multiple of a deviation, is cut to the limits low..high."""
    ends = (None if end is None else min(max(end, low), high) for end in (q.low, q.high))
    return {"value": q.value, **dict(zip(("low", "high"), ends, strict=True)), "unit": q.unit, **_source(q.source)}


def _source(source: str) -> dict[str, str]:
    return {"source": source} if source else {}
