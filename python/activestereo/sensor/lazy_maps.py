# SPDX-License-Identifier: Apache-2.0
"""The depth engine's maps of one picture: those that have been read of an earlier picture are computed together, any
other when it is first read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

Compute = Callable[[list[str]], Mapping[str, Any]]


class LazyMaps:
    """compute, in each call: gives the named maps of the last picture. wanted: what is computed with the first."""

    def __init__(self, *wanted: str) -> None:
        self._wanted = list(wanted)
        self._found: dict[str, Any] = {}
        self._has_begun = False

    def __bool__(self) -> bool:
        """Whether the last picture has been matched."""
        return self._has_begun

    def clear(self) -> None:
        self._found, self._has_begun = {}, False

    def begin(self, compute: Compute) -> None:
        self.clear()
        self._found = dict(compute(self._wanted)) if self._wanted else {}
        self._has_begun = True

    def read(self, name: str, compute: Compute) -> Any:
        self.complete([name], compute)
        if name not in self._wanted:
            self._wanted.append(name)
        return self._found[name]

    def complete(self, names: Iterable[str], compute: Compute) -> None:
        """Has these at hand, as before the engine changes: all maps of a picture are of one engine."""
        missing = [name for name in names if name not in self._found]
        if missing:
            self._found |= compute(missing)

    def values(self) -> Iterable[Any]:
        """Those that were computed."""
        return self._found.values()
