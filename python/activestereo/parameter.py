"""One parameter of an engine, as the sensor's configuration and the command line show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Parameter:
    """A row of a generated table (capi/tables)."""

    name: str  # the same in C, C++ and Python
    kind: type[Any]  # int, float, bool, or str for one of `choices`
    default: Any
    unit: str = ""
    possible: str = ""  # the range in words
    choices: tuple[str, ...] = ()
    pair: str = ""  # this and the next parameter are also the width and height of the option --<pair> WxH
    doc: str = ""

    @property
    def option(self) -> str:
        """Its name on the command line."""
        return "--" + self.name.replace("_", "-")
