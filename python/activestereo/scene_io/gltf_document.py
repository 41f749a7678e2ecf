# SPDX-License-Identifier: Apache-2.0
"""The JSON of a glTF file, be it text or the first chunk of a .glb."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

from activestereo.common.input_files import open_file


def read_document(path: Path) -> tuple[dict[str, Any], int | None]:
    """The document, and where the binary chunk of a .glb begins in the file (glTF 2.0, section 4.4); None: there is
    none. OSError, ValueError, TypeError or struct.error where this is no glTF."""
    with open_file(path) as file:
        head = file.read(20)
        if head[:4] != b"glTF":
            return dict(json.loads(head + file.read())), None
        (length,) = struct.unpack_from("<I", head, 12)
        document = dict(json.loads(file.read(length)))
        return document, 28 + length if len(file.read(8)) == 8 else None
