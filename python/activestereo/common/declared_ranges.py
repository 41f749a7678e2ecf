# SPDX-License-Identifier: Apache-2.0
"""Ranges from which random worlds are drawn: a dataclass with (low, high) for each quantity; a .toml file may replace
some."""

from __future__ import annotations

from dataclasses import fields
from math import inf
from pathlib import Path
from typing import ClassVar, TypeVar

import numpy as np

from activestereo.common.input_files import read_toml


class DeclaredRanges:
    """Base class of ranges from which random worlds draw uniformly; subclasses are frozen dataclasses with a field
    (low, high) for each quantity. LIMITS: {field: lowest and highest allowed ends}, by default 0 and infinity. Raises
    ValueError with the range and its fault."""

    LIMITS: ClassVar[dict[str, tuple[float, float]]] = {}

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            is_pair = isinstance(value, (tuple, list)) and len(value) == 2
            if not is_pair or not all(isinstance(v, (int, float)) and np.isfinite(v) for v in value):
                raise ValueError(f"the range {name} is two finite numbers, low and high, not {value}")
            low, high = value
            least, most = self.LIMITS.get(name, (0.0, inf))
            if low > high:
                raise ValueError(f"the range {name} goes from {low} to {high}; it must rise from at least {least:g}")
            if not least <= low <= high <= most:
                raise ValueError(f"the range {name} must lie within {least:g} to {most:g}, not {(low, high)}")
            object.__setattr__(self, name, (low, high))

    def draw(self, name: str, random: np.random.Generator) -> float:
        return float(random.uniform(*getattr(self, name)))

    def count(self, name: str, random: np.random.Generator) -> int:
        low, high = getattr(self, name)
        return int(random.integers(int(low), int(high) + 1))


Kind = TypeVar("Kind", bound=DeclaredRanges)


def read_ranges(path: Path | None, kind: type[Kind]) -> Kind:
    """Reads ranges of class `kind` from a .toml file; ranges that it lacks, or all if `path` is None, keep their
    defaults. Raises ValueError with the file and its fault."""
    if path is None:
        return kind()
    given = read_toml(path)
    try:
        known = sorted(field.name for field in fields(kind))
        if unknown := sorted(set(given) - set(known)):
            raise ValueError(f"there is no range '{unknown[0]}' (known: {', '.join(known)})")
        return kind(**given)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
