# SPDX-License-Identifier: Apache-2.0
"""Numbers and images as one answer: four bytes with the length of a JSON text, that text, then each image's values.

The text's "arrays" are {name: [type, height, width, first byte behind the text]}; the text ends at a multiple of eight.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.output_files import finite

_ALIGNMENT = 8


def packed(content: Mapping[str, Any], images: Mapping[str, NDArray[Any]] | None = None) -> bytes:
    """One answer. images: {name: [height][width] of float32, uint8 or uint32}; NaN = no value."""
    arrays, parts, size = {}, [], 0
    for name, image in (images or {}).items():
        data = np.ascontiguousarray(image).astype(image.dtype.newbyteorder("<"), copy=False).tobytes()
        arrays[name] = [image.dtype.name, *image.shape, size]
        parts.append(data + b"\0" * (-len(data) % _ALIGNMENT))
        size += len(parts[-1])
    text = json.dumps(finite({**content, "arrays": arrays}), allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-(4 + len(text)) % _ALIGNMENT)
    return b"".join([struct.pack("<I", len(text)), text, *parts])


def unpacked(answer: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """The content and the images of an answer."""
    (length,) = struct.unpack_from("<I", answer)
    content = json.loads(answer[4 : 4 + length])
    images = {}
    for name, (kind, height, width, first) in content.pop("arrays").items():
        flat = np.frombuffer(answer, np.dtype(kind).newbyteorder("<"), height * width, 4 + length + first)
        images[name] = flat.reshape(height, width)
    return content, images
