# SPDX-License-Identifier: Apache-2.0
"""Distributes work over worker processes, which end when the process that started them ends."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from multiprocessing import current_process, get_all_start_methods, get_context, parent_process
from multiprocessing.connection import wait
from typing import Any, Literal

MOST_LOSSES = 3  # pools in a row that end without a result
# In a process of forked(): its work and all items, which are not copied.
_job: tuple[Callable[[Any], object], Sequence[Any]]


@contextmanager
def process_pool(
    count: int, begin: Callable[..., object], *arguments: Any, method: Literal["spawn", "fork"] = "spawn"
) -> Iterator[ProcessPoolExecutor]:
    """Yields a pool of `count` processes that have each called begin(*arguments). Leaving the block cancels work that
    has not begun and ends the processes. They also end with this process. method: 'fork' shares this process's memory,
    but GPU devices do not survive it."""
    pool = ProcessPoolExecutor(count, get_context(method), initializer=_begin, initargs=(begin, arguments))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def done_in_pools(
    pool: Callable[[], AbstractContextManager[ProcessPoolExecutor]], work: Callable[[Any], object], items: Sequence[Any]
) -> Iterator[tuple[int, Future[Any]]]:
    """Runs work(item) for all items in processes. Yields (index of the item, its future) as each ends. pool(): makes a
    process pool. If a process is killed, its pool breaks, and a new pool takes the unfinished items. After three pools
    in a row without a result, it yields the rest as failed futures."""
    left, losses = list(range(len(items))), 0
    while left:
        lost: dict[int, Future[Any]] = {}
        with pool() as processes:
            futures = {processes.submit(work, items[i]): i for i in left}
            for future in as_completed(futures):
                if isinstance(future.exception(), BrokenProcessPool):
                    lost[futures[future]] = future
                else:
                    yield futures[future], future
        losses = losses + 1 if len(lost) == len(left) else 0
        if losses == MOST_LOSSES:
            yield from lost.items()
            return
        left = sorted(lost)


def forked(work: Callable[[Any], object], items: Sequence[Any], workers: int) -> Iterator[tuple[int, Future[Any]]]:
    """Runs work(item) for all items in forked processes and yields (index of the item, its future) as each ends. Yields
    nothing for one item or one worker, without fork, or in a daemon process: the caller then does the work itself.
    Forked processes share all data without a copy. Threads would not help: Python runs one at a time between NumPy
    calls, so sixteen take longer than two. A killed process is replaced. An interrupt ends the processes silently,
    since the caller gets it, too."""
    if min(workers, len(items)) < 2 or "fork" not in get_all_start_methods() or current_process().daemon:
        return
    # Python 3.12 warns if there are other threads; the processes use no lock that those may hold.
    pool = partial(process_pool, min(workers, len(items)), _take_job, work, items, method="fork")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        yield from done_in_pools(pool, _done, range(len(items)))


def return_freed_memory() -> None:
    """Returns memory that was freed to the system. The C library keeps it for this process, gigabytes after work on
    large images, while forked processes need their own."""
    gc.collect()
    with suppress(OSError, AttributeError, TypeError):  # a C library without it keeps nothing, or cannot be asked
        ctypes.CDLL(None).malloc_trim(0)


def _take_job(work: Callable[[Any], object], items: Sequence[Any]) -> None:
    """Begins a forked process. A signal ends it silently."""
    global _job
    _job = work, items
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


def _done(i: int) -> object:
    work, items = _job
    return work(items[i])


def _begin(begin: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_parent, name="ends with its parent", daemon=True).start()
    begin(*arguments)


def _end_with_parent() -> None:
    """Ends this worker process when its parent ends. The worker itself keeps the pipe of its tasks open, so without
    this it would wait for ever."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
