# SPDX-License-Identifier: Apache-2.0
"""Reads the tables of the public structs (*.toml) and checks them. All generated files follow from these tables."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import tomllib

FOLDER = Path(__file__).resolve().parent

# Type in a table: C type, bytes.
SCALARS = {
    "float": ("float", 4),
    "double": ("double", 8),
    "uint8": ("uint8_t", 1),
    "uint32": ("uint32_t", 4),
    "int32": ("int32_t", 4),
    "uint64": ("uint64_t", 8),
    "int64": ("int64_t", 8),
    "char": ("char", 1),
    "flag": ("uint32_t", 4),  # nonzero is yes
    "choice": ("uint32_t", 4),  # one of `values`
    "bits": ("uint32_t", 4),  # some of `values`, or'ed
    "id": ("uint32_t", 4),  # counts from 1; 0 is none
    "index": ("uint32_t", 4),  # counts from 0; `none` (a constant's name) is none
    "text": ("const char*", 8),
}


class TableError(Exception):
    """A table is wrong. The text names the file and the field, and says how to mend it."""


@dataclass
class Field:
    """One field of a public struct. `default` is the value that _init gives."""

    name: str
    type: str
    doc: str = ""
    count: int | str = 1
    shape: tuple[int, ...] = ()
    default: Any = None
    range: tuple[float, float] | None = None
    above: float | None = None  # must be > this
    allowed: tuple[int, ...] = ()
    zero_means: int | str | None = None
    unit: str = ""
    group: str = ""
    values: dict[str, str] = field(default_factory=dict)
    prefix: str = ""
    first: int = 0
    none: str = ""  # constant that means "no index"
    nan: str = ""  # what NaN means
    pair: str = ""  # name of the WIDTHxHEIGHT option that sets this and the next field
    config: bool = True  # in a sensor's configuration
    option: bool = True  # an option of the command line
    short: str = ""  # its short name on the command line and in Python
    one: str = ""  # the word for a single one of the bits
    match: bool = False  # copied into the matcher's parameters
    kernel: bool = False  # a constant of the matcher's shaders
    noise: bool = False  # a noise term of the imager, where it is above 0
    python: bool = True
    shader: bool = False  # part of the record that shaders read
    extras: bool = False  # read from a glTF material's extras
    check: bool = True
    copy: bool = True  # copied between the public struct and the scene's record
    member: str = ""  # its place in the record, if not under its name: "optics.focus_m"
    reserved: bool = False

    @property
    def is_pointer(self) -> bool:
        return self.type not in SCALARS and self.type.rstrip().endswith("*")

    @property
    def c_type(self) -> str:
        return SCALARS[self.type][0] if self.type in SCALARS else self.type

    @property
    def constants(self) -> dict[str, int]:
        """Returns {name in C: number} of the field's choices; for bits, the number of each bit."""
        return {
            self.prefix + name.upper(): 1 << i if self.type == "bits" else self.first + i
            for i, name in enumerate(self.values)
        }


FIELD_KEYS = {f.name for f in fields(Field)} - {"name"}


@dataclass
class Struct:
    """One public struct, as its table describes it."""

    name: str
    doc: str
    fields: list[Field]
    source: str  # the table's file name
    type_id: int | None = None
    reach: str = ""
    init: tuple[str, ...] = ()
    python: str = ""
    answer: bool = False  # the library returns it: Python only reads its fields
    scene: str = ""  # name of the record that is generated from its fields
    record: str = ""  # name of a record, written by hand, to which the fields are copied
    read_back: bool = True  # the fields are also copied back from the record
    checked: bool = False  # the public struct's fields are checked, without a record
    plugin: bool = False  # read by the lab, by neither library
    embedded: bool = False  # stands inside other structs by value, so it can never grow
    shader: str = ""  # name of the record that shaders read
    derived: dict[str, list[str]] = field(default_factory=dict)  # [type, doc] of that record's further members
    steps: dict[str, str] = field(default_factory=dict)  # {name: doc} of the steps of its stage, one launch each

    @property
    def library(self) -> str:
        return self.name.split("_")[0]

    @property
    def type_name(self) -> str:
        library, rest = self.name.split("_", 1)
        return f"{library.upper()}_TYPE_{rest.upper()}"

    def __getitem__(self, name: str) -> Field:
        return next(f for f in self.fields if f.name == name)


STRUCT_KEYS = {f.name for f in fields(Struct)} - {"name", "source"} | {"struct"}


def _require(condition: bool, source: str, name: str, text: str) -> None:
    if not condition:
        raise TableError(f"{source}: {name}: {text}")


def _zero(kind: str) -> Any:
    return 0.0 if kind in ("float", "double") else 0


def _read_field(source: str, name: str, entry: dict[str, Any]) -> Field:
    unknown = set(entry) - FIELD_KEYS
    _require(not unknown, source, name, f"unknown keys {sorted(unknown)} (known: {' '.join(sorted(FIELD_KEYS))})")
    _require("type" in entry, source, name, "it has no type")
    out = Field(name=name, type=entry["type"])
    for key in entry:
        setattr(out, key, tuple(entry[key]) if key in ("shape", "range", "allowed") else entry[key])
    out.doc = " ".join(out.doc.split())
    if out.shape:
        out.count = math.prod(out.shape)
    if name.startswith("reserved"):
        out.reserved, out.python, out.config, out.copy = True, False, False, False
    out.member = out.member or name
    if out.nan:
        out.default = math.nan
    if out.none and out.default is None:
        out.default = out.none
    if out.type in ("choice", "bits"):
        _require(bool(out.values and out.prefix), source, name, f"{out.type} need `prefix` and `values`")
        out.values = {key: " ".join(text.split()) for key, text in out.values.items()}
    if out.type == "choice":
        out.default = next(iter(out.values)) if out.default is None else out.default
        _require(out.default in out.values, source, name, f"default '{out.default}' is none of {list(out.values)}")
    if out.default is None and (out.type in SCALARS and out.type != "text"):
        out.default = _zero(out.type)
    if out.range and not isinstance(out.default, (str, list)) and not math.isnan(out.default):
        zero = out.zero_means is not None and out.default == 0
        _require(
            zero or out.range[0] <= out.default <= out.range[1],
            source,
            name,
            f"default {out.default} is outside of {out.range}",
        )
    return out


def read_struct(path: Path) -> Struct:
    """Returns the Struct of one table. Raises TableError."""
    with path.open("rb") as file:
        try:
            data = tomllib.load(file)
        except tomllib.TOMLDecodeError as error:
            raise TableError(f"{path.name}: {error}") from error
    unknown = set(data) - STRUCT_KEYS
    _require(
        not unknown, path.name, "struct", f"unknown keys {sorted(unknown)} (known: {' '.join(sorted(STRUCT_KEYS))})"
    )
    read = {
        "doc": " ".join(data["doc"].split()),
        "fields": [_read_field(path.name, name, entry) for name, entry in data["fields"].items()],
        "init": tuple(data.get("init", ())),
    }
    return Struct(name=data.pop("struct"), source=path.name, **data | read)


@dataclass
class Header:
    """One generated public header: its comment, structs, includes and further declarations."""

    path: str
    doc: str
    structs: list[Struct]
    includes: list[str] = field(default_factory=list)
    text: str = ""  # declarations before the constants and the structs
    after: str = ""  # declarations after the structs


@dataclass
class Tables:
    """All tables: the headers, and the structs by name."""

    headers: list[Header]
    structs: dict[str, Struct]

    def of(self, library: str) -> list[Struct]:
        return [s for s in self.structs.values() if s.library == library]


def read_tables() -> Tables:
    """Returns every table, in the order of headers.toml. Raises TableError."""
    paths = sorted((FOLDER / "tables").glob("*.toml"))
    found = {path.stem: read_struct(path) for path in paths if path.stem != "headers"}
    for stem, struct in found.items():
        _require(stem == struct.name, f"{stem}.toml", "struct", f"the file is named as its struct, {struct.name}.toml")
    with (FOLDER / "tables/headers.toml").open("rb") as file:
        listed = tomllib.load(file)
    headers, structs = [], {}
    for path, entry in listed.items():
        for name in entry["structs"]:
            _require(name in found, "headers.toml", path, f"there is no {name}.toml")
            structs[name] = found.pop(name)
        prose = {key: entry[key].strip() for key in ("doc", "text", "after") if key in entry}
        headers.append(Header(path, **entry | prose | {"structs": [structs[name] for name in entry["structs"]]}))
    _require(not found, "headers.toml", ", ".join(found), "no header has this struct")
    ids = [s.type_id for s in structs.values() if s.type_id is not None]
    _require(len(ids) == len(set(ids)), "headers.toml", "type_id", "two structs share one")
    return Tables(headers, structs)
