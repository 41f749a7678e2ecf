# SPDX-License-Identifier: Apache-2.0
"""Loads scene files of every kind: kuafu reads them, after usd-core has converted USD. Also reads the JSON of glTF
files, and guesses the unit of a scene whose size is unlikely."""

from __future__ import annotations

import json
import os
import struct
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.common.input_files import open_file
from activestereo.scene_io.usd import is_usd, load_usd

if TYPE_CHECKING:
    import kuafu


def load_scene_file(
    scene: kuafu.Scene, path: str | PathLike[str], time_s: float | None = None, unit_m: float = 1.0
) -> tuple[float, float, float] | None:
    """Adds a scene file to the scene, at time `time_s` of its animations. unit_m: metres in a unit of the file, such as
    0.001 for a file in millimetres. Returns the radiance of a USD stage's dome light, W/(sr m^2), which the caller must
    set, or None without one. Raises UsdError, a ValueError of one line with the file and the remedy, and the errors of
    Scene.load."""
    if is_usd(path):
        return load_usd(scene, path, time_s, unit_m).ambient
    scene.load(path, np.diag([unit_m, unit_m, unit_m, 1.0]), time_s=time_s)
    return None


def keep_transparent() -> None:
    """Keeps materials of opacity 0 invisible, in all files that this process and its later child processes load."""
    os.environ["KUAFU_LOAD_TRANSPARENT"] = "1"


def read_document(path: Path) -> dict[str, Any]:
    """Reads the JSON of a .gltf or .glb file (glTF 2.0, section 4.4). Raises OSError, ValueError, TypeError or
    struct.error for another file."""
    with open_file(path) as file:
        head = file.read(20)
        if head[:4] != b"glTF":
            return dict(json.loads(head + file.read()))
        return dict(json.loads(file.read(*struct.unpack_from("<I", head, 12))))


def likely_unit(size_m: float) -> float:
    """Guesses a file's unit, in metres, from the scene's size when read as metres."""
    return 0.001 if size_m > 50.0 else 1000.0 if size_m < 2e-3 else 1.0


_UNITS = {0.001: "millimetres", 1.0: "metres", 1000.0: "kilometres"}


def size_hint(size_m: float, unit_m: float = 1.0) -> str:
    """Returns a text that suggests a unit for a scene of unlikely size; an empty text for a likely size. unit_m: the
    unit that the size was read with."""
    factor = likely_unit(size_m)
    if factor == 1.0:
        return ""
    said, unit = f"{size_m:.4g} m" if factor < 1.0 else f"{1e3 * size_m:.2g} mm", factor * unit_m
    named = _UNITS.get(unit, f"units of {unit:g} m")
    return f"{said} large: its file may be in {named}, which --unit {unit:g} says"
