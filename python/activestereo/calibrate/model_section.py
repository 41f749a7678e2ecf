# SPDX-License-Identifier: Apache-2.0
"""One section of model.json, version 2 (activestereo.model), is replaced; the others stay as they are, also those that
this program cannot read."""

import json
from pathlib import Path
from typing import Any

from activestereo.common.input_files import read_json
from activestereo.common.output_files import replace_file
from activestereo.model import SensorModel, model_json
from activestereo.model.read import FORMAT, VERSION


def replace_sections(path: Path, measured: SensorModel, keep_rig: bool = False) -> None:
    """Writes what `measured` says of rig, pattern, imager, effects and materials into the model at `path`, made where
    it does not exist. Effects, nuisances and materials that it names replace those of the same names. keep_rig: of a
    rig that is there already, only the projector's place is replaced.

    ValueError, with the file, where it is no model or one of another version: nothing is written then.
    """
    path = Path(path)
    new = model_json(measured)
    root = _read(path) if path.exists() else {"format": FORMAT, "version": VERSION}
    if keep_rig and "rig" in root and "rig" in new:
        new["rig"] = root["rig"] | {"left_to_projector": new["rig"]["left_to_projector"]}
    root |= {name: new[name] for name in ("rig", "pattern", "imager") if name in new}
    if new["effects"]:
        names = {effect["id"] for effect in new["effects"]}
        kept = [effect for effect in root.get("effects", []) if effect.get("id") not in names]
        root["effects"] = kept + new["effects"]
    if new.get("materials"):
        root["materials"] = root.get("materials", {}) | new["materials"]
    if new["nuisances"]:
        root["nuisances"] = root.get("nuisances", {}) | new["nuisances"]
    text = json.dumps(root, indent=1, allow_nan=False) + "\n"
    replace_file(path, lambda file: file.write(text.encode()))


def _read(path: Path) -> dict[str, Any]:
    model = read_json(path)
    if not isinstance(model, dict) or model.get("format") != FORMAT:
        raise ValueError(f"{path}: format is not {FORMAT!r}: give another file to -o")
    if model.get("version") != VERSION:
        raise ValueError(
            f"{path}: version is {model.get('version')}, sections are written into version {VERSION}: give another "
            "file to -o"
        )
    return model
