# SPDX-License-Identifier: Apache-2.0
"""Defines what simulate and depth share: options and files of confidence and cause maps, and text on matching and stage
times."""

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
    """Returns a text table of times in ms, given as {group: {stage: ms}}. Each group's sum stands first; stages below
    0.1 % of the total are left out."""
    total = sum(sum(stages.values()) for stages in groups.values())
    lines = [f"{'stage':32}{'time':>12}"]
    for group, stages in groups.items():
        lines.append(f"{group:32}{sum(stages.values()):>9.1f} ms")
        lines += [f"  {name:30}{time:>9.1f} ms" for name, time in stages.items() if time >= 0.001 * total]
    return "\n".join(lines)


def matching_words(engine: simsense.Engine) -> dict[str, Any]:
    """Returns the engine's matching parameters as {name: value}, with a word for each enumerated choice."""
    choices = {p.name: p.choices for p in MATCHER if p.choices}
    return {name: choices[name][int(value)] if name in choices else value for name, value in engine.parameters.items()}


def matching_line(engine: simsense.Engine) -> str:
    """Returns one line with the engine's main matching parameters."""
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
    """Returns the names of the optional maps (such as "confidence") that the options request."""
    return tuple(name for name in _MAPS if getattr(args, name))


def write_maps(folder: Path, maps: Mapping[str, np.ndarray]) -> None:
    """Writes each map as folder/NAME.png. maps: {name: [height][width]}; confidence, 0 to 1, becomes 16-bit."""
    from activestereo.common.output_files import write_png

    for name, image in maps.items():
        write_png(folder / f"{name}.png", np.rint(65535.0 * image).astype(np.uint16) if name == "confidence" else image)
