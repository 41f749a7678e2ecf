# SPDX-License-Identifier: Apache-2.0
"""Processes that share work, and end with the one that started them."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from typing import Any, Literal


@contextmanager
def process_pool(
    count: int, begin: Callable[..., object], *arguments: Any, method: Literal["spawn", "fork"] = "spawn"
) -> Iterator[ProcessPoolExecutor]:
    """So many processes, in each of which begin(*arguments) has been called. They end with the block, whose unfinished
    work is cancelled where it is left by an error, and with this process, however that ends. 'fork' has all of this
    process's data at hand; a device does not survive it."""
    pool = ProcessPoolExecutor(count, get_context(method), initializer=_begin, initargs=(begin, arguments))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin(begin: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_parent, name="ends with its parent", daemon=True).start()
    begin(*arguments)


def _end_with_parent() -> None:
    """A worker waits for tasks on a pipe that it holds open itself: without this it would wait for ever."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
