# SPDX-License-Identifier: Apache-2.0
"""Devices run a call on several devices at once, and join their images."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

_Result = TypeVar("_Result")


class Devices:
    """Runs a call on several devices at once, in one thread for each. names: each device's name in error notes."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = list(names)
        self._threads = ThreadPoolExecutor(len(names), "device") if len(names) > 1 else None

    def each(self, call: Callable[[int], _Result]) -> list[_Result]:
        """Calls call(k) for every device number k, all at once, and returns the results in this order. After close()
        the calls run one after another. Raises the first error after all calls have ended."""
        if self._threads is None:
            return [call(k) for k in range(len(self._names))]
        running = [self._threads.submit(call, k) for k in range(len(self._names))]
        try:
            wait(running)
        finally:
            wait(running)  # an interrupt leaves no call under way
        errors: list[BaseException] = []
        for one, name in zip(running, self._names, strict=True):
            if (error := one.exception()) is not None:
                if sys.version_info >= (3, 11):
                    error.add_note(name)
                errors.append(error)
        if errors:
            raise errors[0]
        return [one.result() for one in running]

    def join(self, images: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Joins one array [environments, ...] from each device along the first axis. Returns their common base array if
        all are views of it, else a copy."""
        if len(images) == 1:
            return images[0]
        shape, dtype = (sum(len(image) for image in images), *images[0].shape[1:]), images[0].dtype
        common = images[0].base
        if isinstance(common, np.ndarray) and (common.shape, common.dtype) == (shape, dtype):
            if all(image.base is common for image in images):
                return common
        whole = np.empty(shape, dtype)
        targets = np.split(whole, np.cumsum([len(image) for image in images])[:-1])
        self.each(lambda k: np.copyto(targets[k], images[k]))
        return whole

    def close(self) -> None:
        """Ends the devices' threads."""
        self._threads, threads = None, self._threads
        if threads is not None:
            threads.shutdown()
