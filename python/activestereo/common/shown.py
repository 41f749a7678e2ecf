# SPDX-License-Identifier: Apache-2.0
"""Users' values in messages: one short line, whatever is nested in them."""

from __future__ import annotations

import reprlib
from typing import Any

_MOST_LETTERS = 40


class _Short(reprlib.Repr):
    """Two levels and three entries of each: aliases of YAML make values whose whole text no memory holds."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxlist, self.maxtuple, self.maxdict = 2, 3, 3, 3
        self.maxstring = self.maxother = self.maxlong = _MOST_LETTERS

    def repr_int(self, x: int, level: int) -> str:
        """Python writes no decimals of whole numbers with thousands of digits."""
        return repr(x) if x.bit_length() < 4 * _MOST_LETTERS else f"a whole number of {x.bit_length()} bits"


_short = _Short()


def shown(value: Any) -> str:
    """The value as a message has it, of at most 40 letters and three dots."""
    text = f"{value:g}" if isinstance(value, float) else _short.repr(value)
    return text if len(text) <= _MOST_LETTERS else f"{text[:_MOST_LETTERS]}..."
