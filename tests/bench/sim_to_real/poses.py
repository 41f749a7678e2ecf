# SPDX-License-Identifier: Apache-2.0
"""Finds the poses in a run's pictures that are not there yet, with workers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim_to_real.files import Candidate, RunFolder
from sim_to_real.methods import errors_of_round
from sim_to_real.objects import objects
from sim_to_real.views import round_of_views
from sim_to_real.workers import each_done
from activestereo.common.progress_bar import Progress


def find_poses(
    folder: RunFolder,
    seed: int,
    worlds: tuple[str, ...],
    split: str,
    rounds: int,
    candidates: list[Candidate],
    workers: int,
    progress: Progress | None = None,
) -> dict[str, NDArray[np.float64]]:
    """{world: errors [candidates, views, 2]}; finds missing ones."""
    missing = [
        (world, number)
        for number in range(rounds)
        for world in worlds
        if folder.read_errors(world, split, number, candidates) is None
    ]
    tasks = [(folder.path, seed, world, split, number, candidates) for world, number in missing]
    for done, _ in enumerate(each_done(_find, tasks, workers), 1):
        if progress is not None:
            progress(done / len(missing))
    return {world: errors_of(folder, world, split, rounds, candidates) for world in worlds}


def errors_of(
    folder: RunFolder, world: str, split: str, rounds: int, candidates: list[Candidate]
) -> NDArray[np.float64]:
    """Errors [candidates, views, 2] of finished views. Raises ValueError if one is missing."""
    found = [folder.read_errors(world, split, number, candidates) for number in range(rounds)]
    there = [errors for errors in found if errors is not None]
    if len(there) < len(found) or not there:
        name = folder.errors_path(world, split, len(there))
        raise ValueError(
            f"{folder.path} is not finished: {name} is missing; 'bench_sim_to_real.py run' goes on with it"
        )
    return np.concatenate(there, axis=1)


def _find(path: Path, seed: int, world: str, split: str, number: int, candidates: list[Candidate]) -> None:
    folder, things = RunFolder(path), objects()
    depth, k = folder.read_depth(world, split, number)
    errors = errors_of_round(things, round_of_views(things, seed, split, number), depth, k, candidates)
    folder.write_errors(world, split, number, candidates, errors)
