# SPDX-License-Identifier: Apache-2.0
"""Reads camera data from TOML files. Every figure has its source, and fields.toml gives its allowed range.

name = "D435i"
title = "Intel RealSense D435i"
based_on = "d435"            # another file of the same folder, for figures that this one lacks

[imager]
black_level_dn = { value = 17.0, basis = "measured", source = "least counts of D435i recordings" }
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from os.path import exists, isfile  # unlike Path's, false for a name too long
from pathlib import Path
from typing import Any

from activestereo.common.input_files import read_toml
from activestereo.common.limits import Limits
from activestereo.common.parameter import MATCHER, OPTICS, RENDER, SIGNAL
from activestereo.common.shown import did_you_mean, shown

FOLDER = Path(__file__).parent / "data"
BASES = ("data sheet", "measured", "published", "derived", "estimated")
_LONGEST_CHAIN = 8


@dataclass(frozen=True)
class Field:
    """The allowed values of a camera figure: `count` numbers (0: one number, not a list) within low..high, or one of
    `choices`."""

    doc: str
    unit: str = ""
    count: int = 0
    low: float = -inf
    high: float = inf
    choices: tuple[Any, ...] = ()
    whole: bool = False
    or_zero: bool = False


def _fields() -> dict[str, dict[str, Field]]:
    """Reads fields.toml, {section: {figure: Field}}."""
    tables = {"MATCHER": MATCHER, "OPTICS": OPTICS, "RENDER": RENDER, "SIGNAL": SIGNAL}
    out: dict[str, dict[str, Field]] = {}
    for section, rows in read_toml(Path(__file__).with_name("fields.toml")).items():
        own = out[section] = {}
        for name, row in rows.items():
            table = row.pop("parameter", None)
            if table is None:
                own[name] = Field(**row | {"choices": tuple(row.get("choices", ()))})
                continue
            p = next(p for p in tables[table] if p.name == name)
            low, high = p.range or (-inf, inf)
            own[name] = Field(
                p.doc.split(". ")[0].rstrip("."), p.unit, 0, max(low, row.get("low", -inf)),
                min(high, row.get("high", inf)), p.choices or p.allowed, p.kind is int, p.or_zero,
            )  # fmt: skip
    return out


FIELDS = _fields()


@dataclass(frozen=True)
class Figure:
    """A value, its basis (one of BASES) and its source."""

    value: Any
    basis: str
    source: str


@dataclass(frozen=True)
class CameraData:
    """All figures of a camera, {section: {name: Figure}}, including those inherited through based_on."""

    name: str
    title: str
    figures: dict[str, dict[str, Figure]]

    def value(self, section: str, name: str, default: Any = None) -> Any:
        """Returns a figure's value, a list as a tuple. Raises ValueError if it is missing and there is no default."""
        figure = self.figures.get(section, {}).get(name)
        if figure is None:
            if default is None:
                raise ValueError(f"camera {self.name}: {section}.{name} is missing")
            return default
        return tuple(figure.value) if isinstance(figure.value, list) else figure.value


def camera_names() -> list[str]:
    """Lists the known cameras by file name."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_camera(name: str | Path) -> CameraData:
    """Reads a camera's data by its name (in any case) or the path of a .toml file. Raises ValueError with the figure
    and its fault."""
    return _read(_file_of(name), _LONGEST_CHAIN)


def camera_titles() -> list[str]:
    """Lists the known cameras by the name in their files."""
    return [read_toml(FOLDER / f"{name}.toml")["name"] for name in camera_names()]


def _file_of(name: str | Path) -> Path:
    path = FOLDER / f"{str(name).lower()}.toml"
    if not isfile(path) or "/" in str(name):
        path = Path(name)
        if path.suffix != ".toml":
            titles = camera_titles()
            known = f"known: {', '.join(titles)}, or the path of a .toml file"
            told = f"'{name}'" if exists(name) else shown(str(name))
            raise ValueError(f"unknown sensor {told} ({known}){did_you_mean(name, titles)}")
    return path


def _read(path: Path, chain: int) -> CameraData:
    if chain == 0:
        raise ValueError(f"{path}: based_on: the files are based on one another in a circle")
    try:
        content = read_toml(path)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from error
    figures: dict[str, dict[str, Figure]] = {section: {} for section in FIELDS}
    base = content.pop("based_on", None)
    if base is not None:
        beside = path.parent / f"{base}.toml"
        try:
            beside = beside if isfile(beside) else _file_of(str(base))
        except ValueError as error:
            raise ValueError(f"{path}: based_on: {error}") from None
        figures = {section: dict(entries) for section, entries in _read(beside, chain - 1).figures.items()}
    texts = {key: content.pop(key, None) for key in ("name", "title")}
    for key, text in texts.items():
        if not isinstance(text, str) or not text:
            raise ValueError(f"{path}: {key}: is {shown(text)}, expected text")
    for section, entries in content.items():
        if section not in FIELDS:
            raise ValueError(f"{path}: {_unknown('section', section, FIELDS)}")
        if not isinstance(entries, dict):
            raise ValueError(f"{path}: {section}: is {shown(entries)}, expected a section of figures")
        for key, entry in entries.items():
            if key not in FIELDS[section]:
                raise ValueError(f"{path}: {_unknown(f'figure of {section}', key, FIELDS[section])}")
            figures[section][key] = _figure(f"{path}: {section}.{key}", entry, FIELDS[section][key])
    return CameraData(str(texts["name"]), str(texts["title"]), figures)


def _unknown(kind: str, name: str, known: dict[str, Any]) -> str:
    hint = did_you_mean(name, known) or f"; known: {', '.join(known)}"
    return f"{shown(name)} is no {kind}{hint}"


def _figure(place: str, entry: Any, field: Field) -> Figure:
    if not isinstance(entry, dict) or set(entry) != {"value", "basis", "source"}:
        raise ValueError(f"{place}: expected {{ value = ..., basis = ..., source = ... }}, not {shown(entry)}")
    if entry["basis"] not in BASES:
        raise ValueError(f"{place}: basis is {shown(entry['basis'])}, expected one of {', '.join(BASES)}")
    if not isinstance(entry["source"], str) or not entry["source"].strip():
        raise ValueError(f"{place}: source is empty: say where the figure comes from")
    value, figure = entry["value"], Figure(entry["value"], entry["basis"], entry["source"])
    if field.choices:
        if value not in field.choices or isinstance(value, bool) != isinstance(field.choices[0], bool):
            raise ValueError(f"{place}: is {shown(value)}, expected one of {', '.join(map(repr, field.choices))}")
        return figure
    if field.count and (not isinstance(value, list) or len(value) != field.count):
        raise ValueError(f"{place}: is {shown(value)}, expected {field.count} numbers")
    for part in value if field.count else [value]:
        low = min(field.low, 0.0) if field.or_zero and part == 0 else field.low
        if (fault := Limits(low, field.high, field.unit, field.whole).fault(part)) is not None:
            raise ValueError(f"{place}: {fault}")
    return figure
