# SPDX-License-Identifier: Apache-2.0
"""The depth engine's maps of one picture: those that have been read of an earlier picture are computed together, any
other when it is first read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from numpy.typing import NDArray

Compute = Callable[[list[str]], Mapping[str, NDArray[Any]]]


class LazyMaps:
    """compute, in each call: gives the named maps of the last picture."""

    def __init__(self) -> None:
        self._wanted = ["depth_rgb"]
        self._found: dict[str, NDArray[Any]] = {}

    def __bool__(self) -> bool:
        """Whether there is a depth of the last picture."""
        return bool(self._found)

    def clear(self) -> None:
        self._found = {}

    def begin(self, compute: Compute) -> None:
        self._found = dict(compute(self._wanted))

    def read(self, name: str, compute: Compute) -> NDArray[Any]:
        self.complete([name], compute)
        if name not in self._wanted:
            self._wanted.append(name)
        return self._found[name]

    def complete(self, names: Iterable[str], compute: Compute) -> None:
        """Has these at hand, as before the engine changes: all maps of a picture are of one engine."""
        missing = [name for name in names if name not in self._found]
        if missing:
            self._found |= compute(missing)

    def values(self) -> Iterable[NDArray[Any]]:
        """Those that were computed."""
        return self._found.values()
