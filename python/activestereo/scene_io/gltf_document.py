# SPDX-License-Identifier: Apache-2.0
"""The JSON of a glTF file, be it text or the first chunk of a .glb, and scene files whose unit is not the metre."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.input_files import open_file


def read_document(path: Path) -> dict[str, Any]:
    """The document of a .gltf or .glb file (glTF 2.0, section 4.4). Raises OSError, ValueError, TypeError or
    struct.error for another file."""
    with open_file(path) as file:
        head = file.read(20)
        if head[:4] != b"glTF":
            return dict(json.loads(head + file.read()))
        return dict(json.loads(file.read(*struct.unpack_from("<I", head, 12))))


def scale(unit_m: float) -> NDArray[np.float64]:
    """4x4 from a file's unit to metres."""
    return np.diag([unit_m, unit_m, unit_m, 1.0])


def likely_unit(size_m: float) -> float:
    """The metres of the unit that a scene of this size, read as metres, was written in."""
    return 0.001 if size_m > 50.0 else 1000.0 if size_m < 2e-3 else 1.0


def size_hint(size_m: float) -> str:
    """The unit that a scene of an unlikely size may have been written in, or nothing."""
    unit = likely_unit(size_m)
    if unit == 1.0:
        return ""
    said = f"{size_m:.4g} m" if unit < 1.0 else f"{1e3 * size_m:.2g} mm"
    return f"{said} large: its file may be in {'milli' if unit < 1.0 else 'kilo'}metres, which --unit {unit:g} says"
