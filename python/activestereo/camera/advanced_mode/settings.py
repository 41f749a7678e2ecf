# SPDX-License-Identifier: Apache-2.0
"""Advanced-mode JSON as Intel's Viewer and rs400_advanced_mode write it: one object of keys, or one with the keys under
"parameters"; numbers may be text. The D400's visual presets are such settings."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from activestereo.common.input_files import read_json_object, read_toml
from activestereo.common.nearest import did_you_mean, unknown
from activestereo.common.output_files import write_text

Value = float | str
_TABLE = Path(__file__).with_name("keys.toml")
_IGNORED = ("result", "result:")


@dataclass(frozen=True)
class Key:
    """A row of keys.toml. words: allowed values of a key that is no number. to: names that it sets here. control:
    GROUP.FIELD of pyrealsense2's controls, whose number is control_offset + control_scale x the key."""

    name: str
    default: Value
    to: tuple[str, ...]
    meaning: str
    range: tuple[float, float] = (-math.inf, math.inf)
    words: tuple[str, ...] | None = None
    alias: str = ""
    control: str = ""
    control_scale: float = 1.0
    control_offset: float = 0.0


@cache
def keys() -> dict[str, Key]:
    """All keys by name."""
    rows: dict[str, dict[str, Any]] = read_toml(_TABLE)
    lists = ("to", "range", "words")
    return {
        name: Key(name, **{field: tuple(value) if field in lists else value for field, value in row.items()})
        for name, row in rows.items()
    }


@dataclass(frozen=True)
class AdvancedSettings:
    """values: those of the given keys, by the table's names; an alias stands under its target's name."""

    values: Mapping[str, Value]

    def number(self, name: str) -> float:
        """A key's number: the given one, or the camera's default."""
        return float(self.values.get(name, keys()[name].default))

    def word(self, name: str) -> str:
        return str(self.values.get(name, keys()[name].default))

    def is_changed(self, *names: str) -> bool:
        """Whether one of these keys was given and differs from the camera's default."""
        return any(name in self.values and self.values[name] != keys()[name].default for name in names)

    def as_text(self) -> dict[str, str]:
        """Values as librealsense writes them: of each param- and aux-param- key, and of the others that were given."""
        whole = {name: key.default for name, key in keys().items() if name.startswith(("param-", "aux-param-"))}
        return {name: _text(value) for name, value in sorted({**whole, **self.values}.items())}

    def unmapped(self) -> list[str]:
        """Given keys that differ from the camera's default and set nothing here."""
        return [name for name in self.values if not keys()[name].to and self.is_changed(name)]


def read_settings(path: str | Path) -> AdvancedSettings:
    """The settings of a file. Raises ValueError with the file and each key that is unknown or out of range."""
    return parse_settings(read_json_object(path), str(path))


def parse_settings(content: Mapping[str, Any], source: str) -> AdvancedSettings:
    """read_settings() of a JSON object; `source` stands before an error."""
    inside = content.get("parameters", content)
    if not isinstance(inside, Mapping) or not inside:
        raise ValueError(f"{source}: has no keys of the advanced mode, such as param-secondpeakdelta")
    names = {key.alias: key for key in keys().values() if key.alias} | keys()
    values: dict[str, Value] = {}
    faults = []
    for name, raw in inside.items():
        if name in _IGNORED:
            continue
        if name not in names:
            faults.append(f"{name} is unknown{did_you_mean(name, names)}")
            continue
        key = names[name]
        if key.words is not None:
            value: Value = str(raw)
            is_allowed, possible = not key.words or value in key.words, " or ".join(key.words)
        else:
            try:
                value = float(raw) if not isinstance(raw, bool) else math.nan
            except (TypeError, ValueError):
                value = math.nan
            is_allowed, possible = key.range[0] <= value <= key.range[1], "{:g} to {:g}".format(*key.range)
        if not is_allowed:
            faults.append(f"{name} is {raw!r}, expected {possible}")
            continue
        # The Viewer writes both names with one value; a file edited by hand may differ.
        if values.setdefault(key.name, value) != value:
            faults.append(f"{key.name} and {key.alias} are one setting and differ: {values[key.name]} and {value}")
    if faults:
        raise ValueError(f"{source}: {'; '.join(faults)}")
    return AdvancedSettings(values)


def write_settings(path: str | Path, settings: AdvancedSettings) -> None:
    """The file for the camera: all given keys, as text, as librealsense writes them."""
    values = {name: _text(value) for name, value in sorted(settings.values.items())}
    write_text(path, json.dumps(values, indent=4) + "\n")


def _text(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


_FILE = Path(__file__).with_name("presets.toml")
_EMPTY = ("custom", "default")


def visual_preset(name: str) -> AdvancedSettings:
    """The settings of a preset, by librealsense's name: custom, default, hand, high_accuracy, high_density or
    medium_density. ValueError lists them."""
    if name in _EMPTY:
        return AdvancedSettings({})
    known = read_toml(_FILE)
    if name not in known:
        raise ValueError(unknown("visual preset", name, [*_EMPTY, *known]))
    return parse_settings(known[name], name)
