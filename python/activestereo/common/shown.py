# SPDX-License-Identifier: Apache-2.0
"""Formats users' values and names as one short line for messages, and suggests the known name nearest to a misspelt
one."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Collection, Iterable, Sequence
from difflib import get_close_matches
from typing import Any, TextIO

_MOST_LETTERS = 40
_ENDS = re.compile(r"([\n\t])")


class _Short(reprlib.Repr):
    """Abbreviates nested values to two levels and three entries each, because YAML's aliases can make values too large
    to print."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxlist, self.maxtuple, self.maxdict = 2, 3, 3, 3
        self.maxstring = self.maxother = self.maxlong = _MOST_LETTERS

    def repr_int(self, x: int, level: int) -> str:
        """Shortens whole numbers: Python refuses to print thousands of digits."""
        return repr(x) if x.bit_length() < 4 * _MOST_LETTERS else f"a whole number of {x.bit_length()} bits"


_short = _Short()


def shown(value: Any) -> str:
    """Formats a value for a message. Text beyond 40 characters is cut and ends in three dots."""
    text = f"{value:g}" if isinstance(value, float) else _short.repr(value)
    return text if len(text) <= _MOST_LETTERS else f"{text[:_MOST_LETTERS]}..."


def printable(name: object) -> str:
    """Returns a name's text with control characters and invalid UTF-8 escaped. So a file's name cannot break the line
    or send commands to a terminal."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(name))


def listed(words: Sequence[str]) -> str:
    """Joins words with commas, and with "and" before the last one."""
    return " and ".join([", ".join(words[:-1]), *words[-1:]] if len(words) > 1 else words)


def counted(number: int, noun: str) -> str:
    """Returns the number with a noun, which gets an "s" unless the number is 1."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def two_digits(value: float) -> str:
    """Formats a number with two digits that count, without an exponent below a million: 0.86, 120, 5400."""
    return f"{float(f'{value:.2g}'):g}"


def without_unit(name: str, unit: str) -> str:
    """Returns a parameter's name without its unit: focus for focus_m in m, nearness for nearness_per_m in 1/m."""
    return name.removesuffix("_" + unit.replace("1/", "per ").replace(" ", "_"))


class PlainStream:
    """Wraps a text stream and escapes control characters in all that is written, except line ends and tabs."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write("".join(part if part in ("\n", "\t") else printable(part) for part in _ENDS.split(text)))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def nearest(name: object, known: Iterable[str]) -> str | None:
    """Returns the known name that is most similar, whatever its case, or None if none is similar."""
    by_folded = {other.casefold(): other for other in known}
    close = get_close_matches(str(name)[:_MOST_LETTERS].casefold(), by_folded, 1)
    return by_folded[close[0]] if close else None


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Returns the text "; did you mean 'x'?" if a known name is similar, else an empty text."""
    close = nearest(name, known)
    return f"; did you mean '{close}'?" if close else ""


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """Returns an error message: no `what` has this name. It lists the known names and suggests the most similar one."""
    names = list(known)
    return f"unknown {what} '{str(name)[:_MOST_LETTERS]}' (known: {', '.join(names)}){did_you_mean(name, names)}"


def unknown_effect(name: object, known: Iterable[str]) -> str:
    """Returns unknown()'s message of an effect, with where effects are listed and the option that adds one's own."""
    listing = "'activestereo effect list' has the built-in ones, --effects FILE (in Python effects=) adds yours"
    return f"unknown effect '{str(name)[:_MOST_LETTERS]}': {listing}{did_you_mean(name, known)}"


def require_known(what: str, names: Iterable[object], known: Collection[str]) -> None:
    """Raises ValueError with the message of unknown() for the first of the names that is not known. Raises TypeError
    for a text in place of several names."""
    if isinstance(names, str):
        raise TypeError(f"{what} is {shown(names)}, expected a sequence of names: [{shown(names)}]")
    for name in names:
        if name not in known:
            raise ValueError(unknown(what, name, known))
