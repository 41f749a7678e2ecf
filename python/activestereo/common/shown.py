# SPDX-License-Identifier: Apache-2.0
"""Users' values and names in messages: one short line, whatever is nested or hidden in them."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Sequence
from typing import Any, TextIO

_MOST_LETTERS = 40
_ENDS = re.compile(r"([\n\t])")


class _Short(reprlib.Repr):
    """Two levels and three entries of each: YAML's aliases make values too large to print."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxlist, self.maxtuple, self.maxdict = 2, 3, 3, 3
        self.maxstring = self.maxother = self.maxlong = _MOST_LETTERS

    def repr_int(self, x: int, level: int) -> str:
        """Shortens whole numbers: Python refuses to print thousands of digits."""
        return repr(x) if x.bit_length() < 4 * _MOST_LETTERS else f"a whole number of {x.bit_length()} bits"


_short = _Short()


def shown(value: Any) -> str:
    """A value for messages, at most 40 letters and three dots."""
    text = f"{value:g}" if isinstance(value, float) else _short.repr(value)
    return text if len(text) <= _MOST_LETTERS else f"{text[:_MOST_LETTERS]}..."


def printable(name: object) -> str:
    """The text of a name with control characters and bytes that are no UTF-8 escaped: a file's name cannot end the
    line, nor give a terminal orders."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(name))


def listed(words: Sequence[str]) -> str:
    """Words with commas between, and "and" before the last."""
    return " and ".join([", ".join(words[:-1]), *words[-1:]] if len(words) > 1 else words)


class PlainStream:
    """A stream that escapes control characters, but for the ends of lines and tabs."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write("".join(part if part in ("\n", "\t") else printable(part) for part in _ENDS.split(text)))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
