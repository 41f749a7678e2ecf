# SPDX-License-Identifier: Apache-2.0
"""A method that computes its result once. Callers write parentheses, so a reader sees that work is done."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

_Result = TypeVar("_Result")
_LOCK = "_computed_once_lock"


class _Lock:
    """Holds one lock for each object. Separate locks for an object's methods could let two threads wait for one
    another. A pickled or copied object gets a new lock."""

    def __init__(self) -> None:
        self.lock = threading.RLock()

    def __reduce__(self) -> tuple[type[_Lock], tuple[()]]:
        return _Lock, ()


def computed_once(method: Callable[[Any], _Result]) -> Callable[[Any], _Result]:
    """Decorates a method without arguments: the first call on an object computes the result, and later calls return it.
    While one thread computes, the others wait. An error is not kept. The object needs a `__dict__`."""
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
