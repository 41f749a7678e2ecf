# SPDX-License-Identifier: Apache-2.0
"""Fits made side by side in forked processes, ahead of the work that asks for them.

Python runs one thread at a time between calls of NumPy, so that sixteen threads which fit take longer than two.
Processes that are forked have all observations at hand without a copy; what they fit comes back through the FitCache.
"""

import signal
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import count
from multiprocessing import current_process, get_all_start_methods
from typing import Any

import numpy as np

from activestereo.common.processes import done_in_pools, process_pool
from activestereo.diagnose.refine.fit_cache import FitCache

_numbers = count()
# {number: (memory, work, items)} of the calls under way, which forked processes find here.
_jobs: dict[int, tuple[FitCache, Callable[[Any], object], Sequence[Any]]] = {}


def parallel_prefit(
    memory: FitCache,
    work: Callable[[Any], object],
    items: Sequence[Any],
    workers: int,
    done: Callable[[int], object],
) -> None:
    """Makes the fits that work(item) asks for, of every item, in so many processes; done(i): called after item i.

    A killed process is replaced. Items that fail here, or end their process again and again, are left to the caller's
    own work(item), which then fails aloud.
    An exception of done() ends the call after the fits under way.
    """
    if min(workers, len(items)) < 2 or "fork" not in get_all_start_methods() or current_process().daemon:
        return
    number = next(_numbers)
    _jobs[number] = memory, work, items
    try:
        pools = partial(_forked, min(workers, len(items)))
        for i, future in done_in_pools(pools, _fitted, [(number, i) for i in range(len(items))]):
            if future.exception() is None:
                memory.learn(future.result())
                done(i)
    finally:
        del _jobs[number]


@contextmanager
def _forked(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with the block."""
    with warnings.catch_warnings():
        # Python 3.12 warns where other threads are; the processes use none of what those may hold.
        warnings.simplefilter("ignore", DeprecationWarning)
        with process_pool(processes, _begin, method="fork") as pool:
            yield pool


def _begin() -> None:
    """An interrupt ends a process of the pool silently: the caller hears it, too."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _fitted(place: tuple[int, int]) -> Mapping[str, Mapping[str, np.ndarray]]:
    """The fits that work(items[i]) of a call made. place: the call's number and i."""
    number, i = place
    memory, work, items = _jobs[number]
    before = len(memory)
    work(items[i])
    return memory.since(before)
