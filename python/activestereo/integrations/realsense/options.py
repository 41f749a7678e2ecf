# SPDX-License-Identifier: Apache-2.0
"""Implements the options of pyrealsense2's sensors and filters, and groups the advanced mode's JSON keys by control.

Names, keys and scales are librealsense's (src/ds/advanced_mode/json_loader.hpp)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

from activestereo.camera.advanced_mode.settings import Key, keys
from activestereo.integrations.realsense.enums import option


@dataclass
class option_range:
    min: float = 0.0
    max: float = 0.0
    step: float = 0.0
    default: float = 0.0


class Described:
    """Base of devices and sensors that state their name, serial number and other texts. info: {number of camera_info:
    text}."""

    info: dict[int, str] = {}

    def get_info(self, which: int) -> str:
        if which not in self.info:
            raise RuntimeError(f"info {which} not supported by the device")
        return self.info[which]


class Options:
    """Base of sensors and filters with librealsense's options. ranges: {option that can be set: its range}. read_only:
    {other option: its value}. on_change(option, value): called before an option takes a value; raises an error to
    refuse it."""

    def __init__(
        self, ranges: Mapping[option, option_range], read_only: Mapping[option, float] | None = None,
        on_change: Callable[[option, float], None] = lambda which, value: None,
    ) -> None:  # fmt: skip
        self._ranges, self._read_only, self._on_change = dict(ranges), dict(read_only or {}), on_change
        self._values = {which: r.default for which, r in self._ranges.items()} | self._read_only

    def supports(self, which: option) -> bool:
        return which in self._values

    def get_supported_options(self) -> list[option]:
        return list(self._values)

    def is_option_read_only(self, which: option) -> bool:
        return which in self._read_only

    def get_option(self, which: option) -> float:
        self._require(which)
        return self._values[which]

    def get_option_range(self, which: option) -> option_range:
        self._require(which)
        value = self._values[which]
        return self._ranges.get(which, option_range(value, value, 0.0, value))

    def get_option_description(self, which: option) -> str:
        self._require(which)
        return option(which).name.replace("_", " ")

    def set_option(self, which: option, value: float) -> None:
        """Sets an option. Raises RuntimeError, as librealsense does, for an unknown option or a value out of range."""
        self._require(which)
        if which in self._read_only:
            raise RuntimeError(f"option {option(which).name} is read only")
        r, value = self._ranges[which], float(value)
        if not r.min <= value <= r.max:
            name = option(which).name
            raise RuntimeError(f"out of range value for option {name}: {value:g}, expected {r.min:g} to {r.max:g}")
        self._on_change(which, value)
        self._values[which] = value

    def _require(self, which: option) -> None:
        if which not in self._values:
            known = which in option.__members__.values()
            name = option(which).name.replace("_", " ").title() if known else which
            raise RuntimeError(f"object doesn't support option {name}")


@cache
def controls() -> dict[str, dict[str, Key]]:
    """Returns the advanced mode's groups of controls: {group: {field of the control: key of the JSON}}."""
    groups: dict[str, dict[str, Key]] = {}
    for key in keys().values():
        group, _, name = key.control.partition(".")
        if name:
            groups.setdefault(group, {})[name] = key
    return groups
