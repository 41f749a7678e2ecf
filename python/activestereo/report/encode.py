# SPDX-License-Identifier: Apache-2.0
"""Encodes images as lossless pictures of integer codes, value = low + step * code, which a browser's canvas decodes
exactly.

Codes up to 255 take one plane. Larger codes take two: the high bytes above the low bytes, in a picture of twice the
height.
"""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from PIL import Image

_LARGEST_CODE = 2**16 - 1


def encoded_image(image: np.ndarray, step: float, valid: np.ndarray | None = None) -> dict[str, Any]:
    """Encodes an image [height][width] as {src, low, step, planes, has_empty} for the page's decoder. Values are off by
    half a step at most.

    step: in the values' unit; it grows if 65535 steps do not span the image. valid: mask of pixels with a value, None
    for all; other pixels get code 0, and values start at code 1.
    """
    image = np.asarray(image, dtype=np.float64)
    holds = np.isfinite(image) if valid is None else valid & np.isfinite(image)
    has_empty = not bool(holds.all())
    low, high = (float(image[holds].min()), float(image[holds].max())) if holds.any() else (0.0, 0.0)
    low = step * np.floor(low / step)
    first = int(has_empty)
    step = max(step, (high - low) / (_LARGEST_CODE - first))
    code = np.where(holds, np.rint((np.where(holds, image, low) - low) / step) + first, 0).astype(np.uint16)
    planes = [(code >> 8).astype(np.uint8)] if code.max(initial=0) > 255 else []
    planes.append((code & 255).astype(np.uint8))
    return {
        "src": data_address(np.repeat(np.concatenate(planes)[..., None], 3, axis=2)),
        "low": low - first * step,
        "step": step,
        "planes": len(planes),
        "has_empty": has_empty,
    }


def data_address(pixels: np.ndarray) -> str:
    """Encodes uint8 [height][width][3] as a data URI of lossless WebP, which takes about three quarters of PNG's
    bytes."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="webp", lossless=True, quality=20, method=4)
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}"
