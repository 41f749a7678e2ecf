# SPDX-License-Identifier: Apache-2.0
"""Groups items by a key."""

from collections.abc import Hashable, Iterable
from typing import TypeVar

_Item = TypeVar("_Item")


def grouped(pairs: Iterable[tuple[Hashable, _Item]]) -> list[list[_Item]]:
    """Returns the items of (key, item) pairs, one list for each key, in the order in which they come."""
    groups: dict[Hashable, list[_Item]] = {}
    for key, item in pairs:
        groups.setdefault(key, []).append(item)
    return list(groups.values())
