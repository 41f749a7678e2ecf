# SPDX-License-Identifier: Apache-2.0
"""A KTX2 file of UASTC that is written here, by the package opengl_basisu where it is installed."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from activestereo.scene_io.ktx2 import Ktx2Error, convert

pytest.importorskip("opengl_basisu", reason="the package opengl_basisu is not installed (pip install opengl_basisu)")

_LINEAR, _SRGB = 1, 2  # transfer functions of the Khronos Data Format
_RGB, _RGBA = 0, 3  # UASTC's channels


def ktx2(colour: tuple[int, int, int, int], transfer: int, channels: int) -> bytes:
    """8 x 4 pixels of one colour by mode 8: bits 10111, then four bytes (Binomial's specification of UASTC)."""
    number = 0b10111
    for place, value in enumerate(colour):
        number |= value << (5 + 8 * place)
    level = 2 * number.to_bytes(16, "little")
    sample = struct.pack("<HBB4BII", 0, 127, channels, 0, 0, 0, 0, 0, 0xFFFFFFFF)
    format_ = struct.pack("<IHHBBBB4B8B", 0, 2, 40, 166, 1, transfer, 0, 3, 3, 0, 0, 16, *7 * [0]) + sample
    description = struct.pack("<I", 4 + len(format_)) + format_
    start = 80 + 24
    head = b"\xabKTX 20\xbb\r\n\x1a\n" + struct.pack("<9I", 0, 1, 8, 4, 0, 0, 1, 1, 0)
    head += struct.pack("<4I2Q", start, len(description), 0, 0, 0, 0)
    at = -(-(start + len(description)) // 16) * 16
    head += struct.pack("<3Q", at, len(level), len(level))
    return (head + description).ljust(at, b"\0") + level


@pytest.mark.parametrize(("transfer", "channels"), [(_SRGB, _RGB), (_LINEAR, _RGB), (_SRGB, _RGBA)])
def test_the_stored_numbers_are_the_images(tmp_path: Path, transfer: int, channels: int) -> None:
    colour = (200, 100, 50, 128 if channels == _RGBA else 255)
    (tmp_path / "a.ktx2").write_bytes(ktx2(colour, transfer, channels))
    texture = {"extensions": {"KHR_texture_basisu": {"source": 0}}}
    content = {"asset": {"version": "2.0"}, "images": [{"uri": "a.ktx2"}], "textures": [texture]}
    (tmp_path / "a.gltf").write_text(json.dumps(content))
    out = tmp_path / "out"
    out.mkdir()
    convert(tmp_path / "a.gltf", out)
    pixels = np.asarray(Image.open(out / "image_0.png"))
    assert pixels.shape == (4, 8, 4 if channels == _RGBA else 3)
    assert (pixels == colour[: pixels.shape[2]]).all()
    (tmp_path / "a.ktx2").write_bytes(ktx2(colour, transfer, channels)[:90])
    with pytest.raises(Ktx2Error, match="a.gltf"):
        convert(tmp_path / "a.gltf", out)
