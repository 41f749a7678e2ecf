# SPDX-License-Identifier: Apache-2.0
"""What is drawn anew for each frame, and from which ranges: Ranges, or a .toml file with some of its fields."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Ranges:
    """Each (low, high), drawn evenly between them."""

    things: tuple[float, float] = (3, 6)  # how many, at most as many as there are files
    spread_m: tuple[float, float] = (0.15, 0.25)  # radius of the place where they lie
    distance_m: tuple[float, float] = (0.5, 1.0)  # of the camera from the middle
    elevation_deg: tuple[float, float] = (30, 80)  # of the camera above the table
    roll_deg: tuple[float, float] = (-10, 10)
    lamps: tuple[float, float] = (1, 3)  # how many
    lamp_w_per_sr: tuple[float, float] = (0.5, 3.0)
    ambient_radiance: tuple[float, float] = (0.05, 0.4)
    table_albedo: tuple[float, float] = (0.1, 0.8)
    table_roughness: tuple[float, float] = (0.3, 1.0)

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            is_pair = isinstance(value, (tuple, list)) and len(value) == 2
            if not is_pair or not all(isinstance(v, (int, float)) and np.isfinite(v) for v in value):
                raise ValueError(f"the range {field.name} is two finite numbers, low and high, not {value}")
            low, high = value
            floor = -360.0 if field.name == "roll_deg" else 0.0
            if not floor <= low <= high:
                raise ValueError(
                    f"the range {field.name} goes from {low} to {high}; it must rise from at least {floor:g}"
                )
            object.__setattr__(self, field.name, (low, high))
        for name, low, high in (("distance_m", 0.05, 100.0), ("elevation_deg", 1.0, 89.9), ("table_albedo", 0.0, 1.0)):
            if not low <= getattr(self, name)[0] <= getattr(self, name)[1] <= high:
                raise ValueError(f"the range {name} must lie within {low:g} to {high:g}, not {getattr(self, name)}")

    def draw(self, name: str, random: np.random.Generator) -> float:
        return float(random.uniform(*getattr(self, name)))

    def count(self, name: str, random: np.random.Generator) -> int:
        low, high = getattr(self, name)
        return int(random.integers(int(low), int(high) + 1))


def read_ranges(path: Path | None) -> Ranges:
    """The defaults where there is no file. ValueError names the file and what is wrong in it."""
    if path is None:
        return Ranges()
    try:
        given = tomllib.loads(path.read_text())
        known = {field.name for field in fields(Ranges)}
        unknown = sorted(set(given) - known)
        if unknown:
            raise ValueError(f"there is no range '{unknown[0]}' (known: {', '.join(sorted(known))})")
        return Ranges(**given)
    except (ValueError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: {error}") from error
