# SPDX-License-Identifier: Apache-2.0
"""The known name that an unknown one probably stands for."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: object, known: Iterable[str]) -> str | None:
    """The known name that is closest in any case, or None where none is close."""
    by_folded = {other.casefold(): other for other in known}
    close = get_close_matches(str(name).casefold(), by_folded, 1)
    return by_folded[close[0]] if close else None


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """"; did you mean 'x'?" where one of the known names is close, else nothing."""
    close = nearest(name, known)
    return f"; did you mean '{close}'?" if close else ""


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """A message: there is no `what` of this name, the known ones, and the nearest of them."""
    names = list(known)
    return f"unknown {what} '{name}' (known: {', '.join(names)}){did_you_mean(name, names)}"
