# SPDX-License-Identifier: Apache-2.0
"""Describes the engines' parameters for the sensor's configuration and the command line. The rows come from
parameters.json, which capi/generation writes."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from activestereo.common.input_files import read_json


@dataclass(frozen=True)
class Parameter:
    name: str  # the same in C, C++ and Python
    kind: type[Any]  # int, float, bool, str (perhaps one of `choices`), or tuple for several of `choices`
    default: Any
    unit: str = ""
    possible: str = ""  # the range in words
    range: tuple[float, float] | None = None
    allowed: tuple[int, ...] = ()  # the only numbers that it may be
    or_zero: bool = False  # 0 has a special meaning; it is allowed outside the range
    choices: tuple[str, ...] = ()
    short: str = ""  # its other name in Python and on the command line
    one: str = ""  # name of one entry of a tuple
    on_command_line: bool = True
    is_noise: bool = False  # a noise term of the imager
    pair: str = ""  # this and the next parameter are also the width and height of the option --<pair> WxH
    doc: str = ""

    def takes(self, value: float) -> bool:
        """Returns whether a number is in the range and, if `allowed` is not empty, one of these; or 0 with or_zero."""
        if self.or_zero and value == 0:
            return True
        low, high = self.range or (value, value)
        return low <= value <= high and (not self.allowed or value in self.allowed)

    @property
    def option(self) -> str:
        """The parameter's option on the command line; for a tuple, the option that adds one entry."""
        return "--" + (self.one or self.name).replace("_", "-")


def _table(rows: list[dict[str, Any]]) -> tuple[Parameter, ...]:
    kinds = {"int": int, "float": float, "bool": bool, "str": str, "tuple": tuple}
    out = []
    for row in rows:
        kind, ends = kinds[row["kind"]], None
        if "range" in row:
            low, high = row["range"]
            ends = -inf if low is None else low, inf if high is None else high
        own: dict[str, Any] = {
            "kind": kind,
            "default": row["default"] if row["default"] is None else kind(row["default"]),
            "range": ends,
        }
        tuples: dict[str, Any] = {name: tuple(row.get(name, ())) for name in ("choices", "allowed")}
        out.append(Parameter(**(row | tuples | own)))
    return tuple(out)


_TABLES = read_json(Path(__file__).with_name("parameters.json"))
MATCHER, RIG, SIGNAL, RENDERER, RENDER, OPTICS = (
    _table(_TABLES[name]) for name in ("MATCHER", "RIG", "SIGNAL", "RENDERER", "RENDER", "OPTICS")
)
