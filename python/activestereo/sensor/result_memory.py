# SPDX-License-Identifier: Apache-2.0
"""Arrays for results, reused when nobody holds them any more. The kernel clears every page of new memory, which costs
more than writing the results."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_MOST_FREE = 2  # of a result: the caller holds one during the next computation


class Kind(NamedTuple):
    """Shape and type of a result of one environment."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class ResultMemory:
    """Arrays [count, ...] by names. reserve() in one thread at a time; arrays may be let go of in any."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._kinds: dict[str, Kind] = {}
        self._free: dict[str, list[NDArray[Any]]] = {}

    def learn(self, kinds: dict[str, Kind]) -> None:
        self._kinds |= kinds

    def reserve(self, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        """Returns {name: array} with undefined contents, or {} if a name's shape is not known yet. The caller owns an
        array as long as it or a view of it lives."""
        names = list(names)
        return {name: self._array(name) for name in names} if all(name in self._kinds for name in names) else {}

    def _array(self, name: str) -> NDArray[Any]:
        free, kind = self._free.setdefault(name, []), self._kinds[name]
        memory = free.pop() if free else np.empty((self._count, *kind.shape), kind.dtype)
        lent = _Lent(memory)
        weakref.finalize(lent, _give_back, free, memory).atexit = False
        return np.asarray(lent)


class _Lent:
    """Memory that an array and all its views keep alive."""

    def __init__(self, memory: NDArray[Any]) -> None:
        self.__array_interface__ = memory.__array_interface__


def _give_back(free: list[NDArray[Any]], memory: NDArray[Any]) -> None:
    if len(free) < _MOST_FREE:
        free.append(memory)


class JoinedResults:
    """Results of several parts, one after another in common arrays. counts: environments in each part. Parts may
    reserve theirs in threads of their own."""

    def __init__(self, counts: Sequence[int]) -> None:
        ends = np.cumsum(counts).tolist()
        self._memory = ResultMemory(ends[-1])
        self._own = [slice(end - count, end) for end, count in zip(ends, counts, strict=True)]
        self._whole: dict[str, NDArray[Any]] = {}
        self._taken: set[tuple[str, int]] = set()  # names and parts
        self._lock = threading.Lock()

    def begin(self) -> None:
        """Forgets the last picture's results before the next ones are reserved."""
        self._whole, self._taken = {}, set()

    def part(self, number: int) -> PartOfResults:
        return PartOfResults(self, number)

    def learn(self, kinds: dict[str, Kind]) -> None:
        with self._lock:
            self._memory.learn(kinds)

    def reserve(self, number: int, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        own = {(name, number) for name in names}
        with self._lock:
            missing = [name for name, _ in own if name not in self._whole or (name, number) in self._taken]
            new = self._memory.reserve(missing)
            if len(new) < len(missing):
                return {}
            self._whole |= new
            self._taken = {one for one in self._taken if one[0] not in new} | own
            return {name: self._whole[name][self._own[number]] for name, _ in own}


class PartOfResults:
    """A ResultMemory of one part."""

    def __init__(self, results: JoinedResults, number: int) -> None:
        self.learn = results.learn
        self.reserve = partial(results.reserve, number)
