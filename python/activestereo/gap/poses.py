# SPDX-License-Identifier: Apache-2.0
"""Finds the poses in a run's pictures that are not there yet, with workers."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.gap.files import Candidate, RunFolder
from activestereo.gap.methods import errors_of_round
from activestereo.gap.objects import objects
from activestereo.gap.views import round_of_views
from activestereo.progress_bar import Progress

_Task = tuple[Path, int, str, str, int, list[Candidate]]


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
    """{world: errors [candidates, views, 2]}; finds what is missing."""
    missing = [
        (world, number)
        for number in range(rounds)
        for world in worlds
        if folder.read_errors(world, split, number, candidates) is None
    ]
    tasks = [(folder.path, seed, world, split, number, candidates) for world, number in missing]
    for done, _ in enumerate(_done(tasks, workers), 1):
        if progress is not None:
            progress(done / len(missing))
    return {world: errors_of(folder, world, split, rounds, candidates) for world in worlds}


def errors_of(
    folder: RunFolder, world: str, split: str, rounds: int, candidates: list[Candidate]
) -> NDArray[np.float64]:
    """[candidates, views, 2] of what is there. ValueError where something is missing."""
    found = [folder.read_errors(world, split, number, candidates) for number in range(rounds)]
    there = [errors for errors in found if errors is not None]
    if len(there) < len(found) or not there:
        name = folder.errors_path(world, split, len(there))
        raise ValueError(f"{folder.path} is not finished: {name} is missing; 'activestereo gap run' goes on with it")
    return np.concatenate(there, axis=1)


def _done(tasks: list[_Task], workers: int) -> Iterator[None]:
    if workers == 1 or len(tasks) < 2:
        for task in tasks:
            _find(*task)
            yield
        return
    with _pool(workers) as pool:
        pending = [pool.submit(_find, *task) for task in tasks]
        try:
            for done in as_completed(pending):
                done.result()
                yield
        except BrokenProcessPool as error:
            raise ChildProcessError(
                "a worker was ended from outside, perhaps for want of memory; what is done is kept: run the same again"
            ) from error


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Begun anew (spawn), since a device does not survive a fork. Left by an error, it does no more."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=cv2.setNumThreads, initargs=(1,))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _find(path: Path, seed: int, world: str, split: str, number: int, candidates: list[Candidate]) -> None:
    folder, things = RunFolder(path), objects()
    depth, k = folder.read_depth(world, split, number)
    errors = errors_of_round(things, round_of_views(things, seed, split, number), depth, k, candidates)
    folder.write_errors(world, split, number, candidates, errors)
