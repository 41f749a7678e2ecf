# SPDX-License-Identifier: Apache-2.0
"""Provides a decorator for methods that compute once, and a base of classes that keep results by name. Callers write
parentheses, so a reader sees that work is done."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

_Result = TypeVar("_Result")
_LOCK = "_computed_once_lock"


class _Lock:
    """Holds the lock that all decorated methods of one object share. With a lock for each method, two threads could
    wait for each other for ever. A pickled or copied object gets a new lock."""

    def __init__(self) -> None:
        self.lock = threading.RLock()

    def __reduce__(self) -> tuple[type[_Lock], tuple[()]]:
        return _Lock, ()


def computed_once(method: Callable[[Any], _Result]) -> Callable[[Any], _Result]:
    """Decorates a method without arguments: the first call on an object computes the result, later ones return it.
    Other threads wait for the first. After an error, the next call computes again. The object needs a `__dict__`."""
    name = f"_{method.__name__}_computed"

    @wraps(method)
    def kept(self: Any) -> _Result:
        known = self.__dict__
        if name not in known:
            with known.setdefault(_LOCK, _Lock()).lock:
                if name not in known:
                    known[name] = method(self)
        return known[name]

    return kept


def once_of_picked(known: list[tuple[np.ndarray, Any]], pick: np.ndarray, make: Callable[[], Any]) -> Any:
    """Returns make(), or its stored value if it was computed before for the same pixels `pick`. known: the stored pairs
    (pick, value); a new pair is added."""
    for before, value in known:
        if before is pick or np.array_equal(before, pick):
            return value
    known.append((pick, make()))
    return known[-1][1]


class Remembering:
    """Keeps results by name in an object."""

    @computed_once
    def _memory(self) -> dict[Hashable, Any]:
        return {}

    def once(self, name: Hashable, make: Callable[[], Any]) -> Any:
        """Returns make(), computed the first time that this object is asked for `name`. Fits ask hundreds of times."""
        known = self._memory()
        if name not in known:
            known[name] = make()
        return known[name]

    def forget(self) -> None:
        """Drops all that is kept."""
        self._memory().clear()
