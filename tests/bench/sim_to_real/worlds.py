# SPDX-License-Identifier: Apache-2.0
"""The worlds: three modes of our simulation, the foreign one, and variants of `full`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class World:
    """mode: 'clean', 'raster' or 'full' of activestereo.sensor.depth_modes, or 'foreign'. samples: rays per pixel, None
    = the run's. noise: the imager's standard deviations over the sensor's own. materials: 'nominal' (the objects'),
    'random' or 'measured'. is_denoised None: the sensor's setting."""

    name: str
    mode: str
    samples: int | None = None
    is_denoised: bool | None = None
    noise: float = 1.0
    materials: str = "nominal"


SIMULATED = ("clean", "raster", "full")
FOREIGN = ("sensor", "mitsuba")  # worlds that stand for reality: of our renderer, or of another project's
WORLDS = {mode: World(mode, mode) for mode in (*SIMULATED, "foreign")}
