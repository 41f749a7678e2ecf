# SPDX-License-Identifier: Apache-2.0
"""A method whose result is kept. It is called with parentheses, so that a reader sees where work is done."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

_Result = TypeVar("_Result")


def computed_once(method: Callable[[Any], _Result]) -> Callable[[Any], _Result]:
    """The method, which works in the first call on an object; all later calls return the same result.

    Of several threads one computes and the others wait. An error is not kept. The object needs a `__dict__`."""
    name, lock = f"_{method.__name__}_computed", threading.RLock()

    @wraps(method)
    def kept(self: Any) -> _Result:
        known = self.__dict__
        if name not in known:
            with lock:
                if name not in known:
                    known[name] = method(self)
        return known[name]

    return kept
