# SPDX-License-Identifier: Apache-2.0
"""Processes that share a run's work."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

import cv2


def each_done(work: Callable[..., None], tasks: Sequence[tuple[Any, ...]], workers: int) -> Iterator[None]:
    """Calls work(*task) of every task, here or in so many processes; yields after each. ChildProcessError where a
    worker was ended from outside."""
    if workers == 1 or len(tasks) < 2:
        for task in tasks:
            work(*task)
            yield
        return
    with _pool(workers) as pool:
        pending = [pool.submit(work, *task) for task in tasks]
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
