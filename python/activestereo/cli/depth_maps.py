# SPDX-License-Identifier: Apache-2.0
"""The parts that simulate and depth share: the maps that explain a depth map (how sure each pixel is, and why a pixel
has none), and the lines that end a command."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from activestereo.common.parameter import MATCHER

if TYPE_CHECKING:
    import simsense


def stage_table(groups: Mapping[str, Mapping[str, float]]) -> str:
    """{group: {stage: milliseconds}} as text, a group's sum first; stages below a tenth of a percent of everything are
    left out."""
    total = sum(sum(stages.values()) for stages in groups.values())
    lines = [f"{'stage':32}{'time':>12}"]
    for group, stages in groups.items():
        lines.append(f"{group:32}{sum(stages.values()):>9.1f} ms")
        lines += [f"  {name:30}{time:>9.1f} ms" for name, time in stages.items() if time >= 0.001 * total]
    return "\n".join(lines)


def matching_words(engine: simsense.Engine) -> dict[str, Any]:
    """The parameters with which a simsense.Engine matches; a choice by its word."""
    choices = {p.name: p.choices for p in MATCHER if p.choices}
    return {name: choices[name][int(value)] if name in choices else value for name, value in engine.parameters.items()}


def matching_line(engine: simsense.Engine) -> str:
    """The main parameters with which a simsense.Engine matches, in one line."""
    p = engine.parameters
    first, last = p["min_disparity"], p["min_disparity"] + p["max_disparity"] - 1
    checks = f"uniqueness {p['uniqueness_ratio']} %, left-right {p['lr_max_diff']}, median {p['median_size']}"
    windows = f"census {p['census_width']}x{p['census_height']}, block {p['block_width']}x{p['block_height']}"
    penalties, depths = f"p1 {p['p1']}, p2 {p['p2']}", f"{p['min_depth_m']:g}..{p['max_depth_m']:g} m"
    return f"matching: disparities {first}..{last}, {windows}, {penalties}, {checks}, {depths}"


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
