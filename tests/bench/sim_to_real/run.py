# SPDX-License-Identifier: Apache-2.0
"""Takes all pictures, tunes the methods, finds all poses. Skips finished parts."""

from __future__ import annotations

from pathlib import Path

from sim_to_real.files import RunFolder
from sim_to_real.mitsuba_scene import mitsuba
from sim_to_real.pictures import take_pictures
from sim_to_real.poses import find_poses
from sim_to_real.settings import BenchmarkSettings
from sim_to_real.tuning import Model, candidates_of, every_candidate, tuned
from sim_to_real.worlds import SIMULATED, WORLDS
from activestereo.common.progress_bar import Progress, part_of

# When each part ends, as a share of the time, about: pictures for tuning and for the test, poses likewise.
_ENDS = (0.1, 0.7, 0.85, 1.0)
# Time of a round of pictures in a world, relative to 'clean'.
_EFFORT = {"clean": 1.0, "raster": 10.0, "full": 20.0, "foreign": 60.0}


def run(
    settings: BenchmarkSettings,
    out: Path,
    device: str | int = "auto",
    workers: int = 1,
    progress: Progress | None = None,
) -> list[Model]:
    """Makes all data of a score under `out`; returns the nine models. Raises ValueError if `out` has results of other
    settings or the foreign world's renderer is missing, and ChildProcessError if a worker is killed. Finished work
    stays, and the same call continues."""
    folder = RunFolder(out)
    if settings.foreign == "mitsuba":
        mitsuba()  # told before hours of work
    folder.keep_settings(settings.described())
    worlds_of = {"tuning": SIMULATED, "test": WORLDS}
    for (split, worlds), start, end in zip(worlds_of.items(), (0.0, _ENDS[0]), _ENDS[:2], strict=True):
        effort = {world: _EFFORT[world] for world in worlds}
        for world in worlds:
            own = part_of(part_of(progress, start, end), *_share(effort, world))
            take_pictures(folder, settings, world, split, settings.rounds(split), device, workers, own)
    every, seed = every_candidate(), settings.seed
    own = part_of(progress, _ENDS[1], _ENDS[2])
    tuning = find_poses(folder, seed, SIMULATED, "tuning", settings.rounds("tuning"), every, workers, own)
    models, own = tuned(tuning, every), part_of(progress, _ENDS[2], _ENDS[3])
    find_poses(folder, seed, WORLDS, "test", settings.rounds("test"), candidates_of(models), workers, own)
    return models


def _share(effort: dict[str, float], world: str) -> tuple[float, float]:
    """The begin and the end of a world's part in the time of all, one after the other."""
    names = list(effort)
    before = sum(effort[name] for name in names[: names.index(world)])
    whole = sum(effort.values())
    return before / whole, (before + effort[world]) / whole
