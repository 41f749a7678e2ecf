# SPDX-License-Identifier: Apache-2.0
"""Suggests the known name that a misspelt one probably stands for."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: object, known: Iterable[str]) -> str | None:
    """Returns the known name that is most similar, whatever its case, or None if none is similar."""
    by_folded = {other.casefold(): other for other in known}
    close = get_close_matches(str(name).casefold(), by_folded, 1)
    return by_folded[close[0]] if close else None


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Returns the text "; did you mean 'x'?" if a known name is similar, else an empty text."""
    close = nearest(name, known)
    return f"; did you mean '{close}'?" if close else ""


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """Returns an error message: no `what` has this name. It lists the known names and suggests the most similar one."""
    names = list(known)
    return f"unknown {what} '{name}' (known: {', '.join(names)}){did_you_mean(name, names)}"
