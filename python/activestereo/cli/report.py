# SPDX-License-Identifier: Apache-2.0
"""Lines that the commands print at their end."""

from collections.abc import Mapping
from typing import Any

import simsense
from activestereo.common.parameter import MATCHER


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
    """How a simsense.Engine matches, by parameter; a choice by its word."""
    choices = {p.name: p.choices for p in MATCHER if p.choices}
    return {name: choices[name][int(value)] if name in choices else value for name, value in engine.parameters.items()}


def matching_line(engine: simsense.Engine) -> str:
    """How a simsense.Engine matches, in one line."""
    p = engine.parameters
    first, last = p["min_disparity"], p["min_disparity"] + p["max_disparity"] - 1
    checks = f"uniqueness {p['uniqueness_ratio']} %, left-right {p['lr_max_diff']}, median {p['median_size']}"
    windows = f"census {p['census_width']}x{p['census_height']}, block {p['block_width']}x{p['block_height']}"
    penalties, depths = f"p1 {p['p1']}, p2 {p['p2']}", f"{p['min_depth_m']:g}..{p['max_depth_m']:g} m"
    return f"matching: disparities {first}..{last}, {windows}, {penalties}, {checks}, {depths}"
