# SPDX-License-Identifier: Apache-2.0
"""The quantities that are drawn again for each frame of a data set, and their ranges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from activestereo.common.declared_ranges import DeclaredRanges


@dataclass(frozen=True)
class Ranges(DeclaredRanges):
    """Each (low, high), drawn evenly between them."""

    things: tuple[float, float] = (3, 6)  # count, at most the number of files
    spread_m: tuple[float, float] = (0.15, 0.25)  # radius of the area of things
    distance_m: tuple[float, float] = (0.5, 1.0)  # of the camera from the middle
    elevation_deg: tuple[float, float] = (30, 80)  # height of the camera above the table
    roll_deg: tuple[float, float] = (-10, 10)
    lamps: tuple[float, float] = (1, 3)  # count
    lamp_w_per_sr: tuple[float, float] = (0.5, 3.0)
    ambient_radiance: tuple[float, float] = (0.05, 0.4)
    table_albedo: tuple[float, float] = (0.1, 0.8)
    table_roughness: tuple[float, float] = (0.3, 1.0)

    LIMITS: ClassVar[dict[str, tuple[float, float]]] = {
        "roll_deg": (-360.0, 360.0),
        "distance_m": (0.05, 100.0),
        "elevation_deg": (1.0, 89.9),
        "table_albedo": (0.0, 1.0),
    }
