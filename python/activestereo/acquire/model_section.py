"""One section of model.json, version 2, is replaced; the others stay as they are."""

import json
from pathlib import Path

from activestereo.output_files import replace_file

FORMAT = "active-stereo-model"
VERSION = 2
SECTIONS = ("rig", "pattern", "imager", "effects", "materials")


def replace_section(path: Path, name: str, section: dict) -> None:
    """Writes `section` under `name` into the model at `path`, which is made where it does not exist.

    ValueError, with the file, where it is no model or one of another version: nothing is written then.
    """
    if name not in SECTIONS:
        raise ValueError(f"a model has no section '{name}' (there are: {', '.join(SECTIONS)})")
    path = Path(path)
    model = _read(path) if path.exists() else {"format": FORMAT, "version": VERSION}
    text = json.dumps(model | {name: section}, indent=1, allow_nan=False) + "\n"
    replace_file(path, lambda file: file.write(text.encode()))


def _read(path: Path) -> dict:
    try:
        model = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path}: not JSON: {error}") from error
    if not isinstance(model, dict) or model.get("format") != FORMAT:
        raise ValueError(f"{path}: format is not {FORMAT!r}: give another file to -o")
    if model.get("version") not in (1, VERSION):
        raise ValueError(f"{path}: version is {model.get('version')}, this program writes version {VERSION}")
    return model | {"version": VERSION}


def measured(value: float, low: float, high: float, unit: str) -> dict:
    """A value with its 90 % interval, as model.json holds it."""
    return {"value": float(value), "low": float(low), "high": float(high), "unit": unit}
