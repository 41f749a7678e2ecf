# SPDX-License-Identifier: Apache-2.0
"""Fits noise models to a sensor, writes their files, and compares them with the sensor in rooms that no fit saw."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from activestereo.benchmarks.noise_profiles.profile import Distance, Profile, distance, fitted, take_views
from activestereo.benchmarks.noise_profiles.simulators import PROFILES
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.output_files import write_text
from activestereo.common.progress_bar import Progress
from activestereo.model import SensorModel

_ROOMS = 6
# First seed of the rooms that no fit saw; rooms of the fit have seeds from 0.
_HELD_OUT_SEED = 2**40


@dataclass(frozen=True)
class Exported:
    """A fitted noise model and its file. default_distance, distance: distances of the unfitted and the fitted model
    from the sensor, in rooms outside the fit; None without such rooms."""

    profile: Profile
    file: Path
    seconds: float
    default_distance: Distance | None
    distance: Distance | None


def export(
    config: StereoDepthSensorConfig, model: SensorModel | None, names: list[str], out: Path, held_out: int = 0,
    seed: int = 0, device: str | int = "auto", progress: Progress | None = None,
) -> dict[str, Exported]:  # fmt: skip
    """Fits the named PROFILES to the sensor, writes their files and returns {name: Exported}; profiles.json has the
    parameters and distances. held_out: number of rooms outside the fit. progress: called with the fraction of the views
    taken, which is nearly all of the time."""
    start = time.perf_counter()
    views = take_views(config, model, _ROOMS, seed, device, progress)
    views_s = time.perf_counter() - start
    fits: dict[str, tuple[Profile, float]] = {}
    for name in names:
        start = time.perf_counter()
        fits[name] = fitted(PROFILES[name], views), views_s + time.perf_counter() - start
        write_text(out / PROFILES[name].FILE, fits[name][0].file_text(views))
    others = take_views(config, model, held_out, _HELD_OUT_SEED + seed, device, progress) if held_out else None
    found = {}
    for name, (profile, seconds) in fits.items():
        before, after = (
            None if others is None else distance(others, one.apply(others, np.random.default_rng(1)))
            for one in (type(profile)(), profile)
        )
        found[name] = Exported(profile, out / profile.FILE, seconds, before, after)
    text = json.dumps({name: profile_json(one) for name, one in found.items()}, indent=1)
    write_text(out / "profiles.json", text + "\n")
    return found


def profile_json(one: Exported) -> dict[str, Any]:
    """Returns one profile's part of profiles.json."""
    distances = {"default": one.default_distance, "exported": one.distance}
    return {
        "file": one.file.name,
        "parameters": asdict(one.profile),
        "lacks": list(one.profile.LACKS),
        "held_out": {k: {"error_px": d.error_px, "holes": d.holes} for k, d in distances.items() if d is not None},
    }
