# SPDX-License-Identifier: Apache-2.0
"""Processes that share a run's work."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import cv2

from activestereo.common.processes import process_pool


def each_done(work: Callable[..., None], tasks: Sequence[tuple[Any, ...]], workers: int) -> Iterator[None]:
    """Calls work(*task) of every task, here or in so many processes; yields after each. Raises ChildProcessError if a
    worker was ended from outside."""
    if workers == 1 or len(tasks) < 2:
        for task in tasks:
            work(*task)
            yield
        return
    with process_pool(workers, cv2.setNumThreads, 1) as pool:
        pending = [pool.submit(work, *task) for task in tasks]
        try:
            for done in as_completed(pending):
                done.result()
                yield
        except BrokenProcessPool as error:
            raise ChildProcessError(
                "a worker was ended from outside, perhaps for want of memory; what is done is kept: run the same again"
            ) from error

