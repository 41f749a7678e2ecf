# SPDX-License-Identifier: Apache-2.0
"""Options of simulate and depth for the maps that explain a depth map: how sure each pixel is, and why a pixel has
none."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np

_MAPS = ("confidence", "reason")


def add_depth_maps(group: argparse._ArgumentGroup) -> None:
    text = "write confidence.png too, of the left infrared image: 16 bits, 65535 = sure, 0 = nothing was measured"
    group.add_argument("--confidence", action="store_true", help=text)
    text = (
        "write reason.png too, of the left infrared image: 8 bits, why a pixel has no depth, as simsense.REASONS "
        "counts; 0 = it has one"
    )
    group.add_argument("--reason", action="store_true", help=text)


def wanted_maps(args: argparse.Namespace) -> tuple[str, ...]:
    """The engine's outputs that were asked for."""
    return tuple(name for name in _MAPS if getattr(args, name))


def write_maps(folder: Path, maps: Mapping[str, np.ndarray]) -> None:
    """Each as DIR/<name>.png; images are [height, width]."""
    from activestereo.common.output_files import write_png

    for name, image in maps.items():
        write_png(folder / f"{name}.png", np.rint(65535.0 * image).astype(np.uint16) if name == "confidence" else image)
