# SPDX-License-Identifier: Apache-2.0
"""Commands run in this process, and a pair for them."""

import struct
import zlib
from functools import partial

import numpy as np
import pytest
from command_line import run_here
from PIL import Image


@pytest.fixture
def run(capsys):
    """The command's status and what it wrote."""
    return partial(run_here, capsys)


@pytest.fixture
def ran(run):
    """A command that succeeds: what it wrote."""

    def ran(*words):
        result = run(*words)
        assert result.returncode == 0, result.stderr
        return result

    return ran


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A folder with left.png, right.png 12 px further left, and images that do not go with them."""
    folder = tmp_path_factory.mktemp("pair")
    wide = np.random.default_rng(1).integers(0, 256, (96, 172), dtype=np.uint8)
    for name, image in (
        ("left", wide[:, :160]),
        ("right", wide[:, 12:]),
        ("small", wide[:50, :160]),
        ("gray3", np.dstack([wide[:, :160]] * 3)),
        ("color", np.dstack([wide, wide, 255 - wide])),
    ):
        Image.fromarray(np.ascontiguousarray(image)).save(folder / f"{name}.png")
    (folder / "text.png").write_text("no image")
    Image.fromarray(wide[:, :160].astype(np.uint16)).save(folder / "deep.png")
    Image.fromarray(wide[:, :160].astype(np.int32) - 500).save(folder / "signed.tiff")
    (folder / "vast.png").write_bytes(_png_header(60_000, 60_000))
    return folder


def _png_header(width, height):
    """An 8-bit gray PNG that ends before its pixels."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = (head, b"IDAT")
    framed = (struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)
