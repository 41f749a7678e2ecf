# SPDX-License-Identifier: Apache-2.0
"""Writes the files of a diagnosis: diagnose.json, model.json and effect_stub.py."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from activestereo.common.output_files import write_text
from activestereo.compare.model_file import write_model as write_effects
from activestereo.model import write_model

if TYPE_CHECKING:
    from activestereo.diagnose.diagnosis import Diagnosis


def write_diagnosis(diagnosis: "Diagnosis", folder: str | Path) -> list[Path]:
    """Writes diagnose.json, model.json and, for an unknown effect, effect_stub.py into the folder, made if absent.
    Returns their paths."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    as_text = lambda value: json.dumps(value, indent=1) + "\n"  # noqa: E731
    texts = {"diagnose.json": as_text(diagnosis.result)}
    if diagnosis.stub:
        texts["effect_stub.py"] = diagnosis.stub
    for name, text in texts.items():
        write_text(folder / name, text)
    complete = diagnosis.sensor_model
    paths = [folder / "model.json"]
    if complete is None:
        write_effects(paths[0], diagnosis.model)
    else:
        paths = write_model(paths[0], complete)
    return [*(folder / name for name in texts), *paths]
