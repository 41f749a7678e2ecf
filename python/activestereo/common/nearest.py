# SPDX-License-Identifier: Apache-2.0
"""The known name that an unknown one probably stands for."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: object, known: Iterable[str]) -> str | None:
    """The closest known name in any case, or None if none is close."""
    by_folded = {other.casefold(): other for other in known}
    close = get_close_matches(str(name).casefold(), by_folded, 1)
    return by_folded[close[0]] if close else None


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """ "; did you mean 'x'?" if a known name is close, else an empty text."""
    close = nearest(name, known)
    return f"; did you mean '{close}'?" if close else ""


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """A message: there is no `what` of this name. Lists the known names and the nearest one."""
    names = list(known)
    return f"unknown {what} '{name}' (known: {', '.join(names)}){did_you_mean(name, names)}"
