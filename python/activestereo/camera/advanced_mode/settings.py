# SPDX-License-Identifier: Apache-2.0
"""Reads advanced-mode JSON, as Intel's Viewer and rs400_advanced_mode write it, and the D400's visual presets. The file
is one object of keys, or has the keys under "parameters"; numbers may be text.

Converts the settings to the matcher's parameters, the depth image's units, and the camera's exposure and laser. The
D400's matcher is not published, so a key's value is compared with the camera's default. A key at its default leaves the
matcher's parameter unchanged; another value scales the parameter by the same ratio."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from activestereo.common.input_files import read_json_object, read_toml
from activestereo.common.shown import did_you_mean, unknown

Value = float | str
_TABLE = Path(__file__).with_name("keys.toml")
_IGNORED = ("result", "result:")


@dataclass(frozen=True)
class Key:
    """A key of the advanced mode: a row of keys.toml. words: allowed texts, () = any; None for a number. to: names of
    the parameters that the key sets in this package. control: the same setting in pyrealsense2, as GROUP.FIELD. Its
    value is control_offset + control_scale * the key's value."""

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
    """Reads the table of all keys, {name: Key}."""
    rows: dict[str, dict[str, Any]] = read_toml(_TABLE)
    lists = ("to", "range", "words")
    return {
        name: Key(name, **{field: tuple(value) if field in lists else value for field, value in row.items()})
        for name, row in rows.items()
    }


@dataclass(frozen=True)
class AdvancedSettings:
    """Advanced-mode settings. values: {key: value} of the keys in the file. A key given by its alias has its main name
    here."""

    values: Mapping[str, Value]

    def number(self, name: str) -> float:
        """Returns a key's number from the file, or the camera's default if the file lacks the key."""
        return float(self.values.get(name, keys()[name].default))

    def word(self, name: str) -> str:
        return str(self.values.get(name, keys()[name].default))

    def is_changed(self, *names: str) -> bool:
        """Returns whether the file has one of these keys with another value than the camera's default."""
        return any(name in self.values and self.values[name] != keys()[name].default for name in names)

    def as_text(self) -> dict[str, str]:
        """Returns {key: text} as librealsense writes it: all param- and aux-param- keys, and the file's other keys."""
        whole = {name: key.default for name, key in keys().items() if name.startswith(("param-", "aux-param-"))}
        return {
            name: (value if isinstance(value, str) else f"{value:.6g}")
            for name, value in sorted({**whole, **self.values}.items())
        }

    def unmapped(self) -> list[str]:
        """Lists the file's keys that differ from the camera's default but set no parameter in this package."""
        return [name for name in self.values if not keys()[name].to and self.is_changed(name)]


def read_settings(path: str | Path) -> AdvancedSettings:
    """Reads settings from a JSON file. Raises ValueError with the file and every key that is unknown or out of
    range."""
    return parse_settings(read_json_object(path), str(path))


def parse_settings(content: Mapping[str, Any], source: str) -> AdvancedSettings:
    """Checks a JSON object's keys and returns them as settings. Raises ValueError, which begins with `source`, with
    every key that is unknown or out of range."""
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
            faults.append(f"{name[:60]} is unknown{did_you_mean(name, names)}")
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


_FILE = Path(__file__).with_name("presets.toml")
_EMPTY = ("custom", "default")


def visual_preset(name: str) -> AdvancedSettings:
    """Returns the settings of a visual preset by librealsense's name: custom, default, hand, high_accuracy,
    high_density or medium_density. Raises ValueError with these names for another one."""
    if name in _EMPTY:
        return AdvancedSettings({})
    known = read_toml(_FILE)
    if name not in known:
        raise ValueError(unknown("visual preset", name, [*_EMPTY, *known]))
    return parse_settings(known[name], name)


_SCALED = (
    "param-censususize", "param-censusvsize", "param-scanlinep1", "param-scanlinep2", "param-secondpeakdelta",
)  # fmt: skip
_WIDEST_WINDOW, _WIDEST_BLOCK = 9, 15
_LARGEST_PENALTY = 223
_LEFT_RIGHT_STEPS = 32  # of a pixel
_REGION_PIXELS = 168  # neighbours in a 13x13 window, by which librealsense scales the threshold
_DN_OF_10_BITS = 0.25
_DN_OF_12_BITS = 1 / 16


@dataclass(frozen=True)
class DepthTable:
    """Format of a depth image: metres per unit and the range of depths that it keeps. is_disparity: pixels hold
    disparities instead."""

    unit_m: float
    min_depth_m: float
    max_depth_m: float
    is_disparity: bool


def matcher_parameters(settings: AdvancedSettings, base: Mapping[str, Any]) -> dict[str, Any]:
    """Returns simsense's matcher parameters: `base`, the camera's defaults for 8-bit images, with the settings
    applied."""
    out = dict(base)
    changed, number = settings.is_changed, settings.number
    share = {n: number(n) / float(keys()[n].default) for n in _SCALED}  # a key's number over the camera's default
    for side, name in (("width", "param-censususize"), ("height", "param-censusvsize")):
        out[f"census_{side}"] = _odd(base[f"census_{side}"] * share[name], _WIDEST_WINDOW)
    p2 = max(2, round(base["p2"] * share["param-scanlinep2"]))
    out["p2"] = min(_LARGEST_PENALTY, p2)
    out["p1"] = min(out["p2"] - 1, max(1, round(base["p1"] * share["param-scanlinep1"])))
    if changed("param-scanlinep2", "param-scanlinep2onediscon", "param-scanlineedgetaug"):
        is_lower_at_edges = number("param-scanlinep2onediscon") < number("param-scanlinep2")
        edge_dn = max(1, round(_DN_OF_10_BITS * number("param-scanlineedgetaug")))
        out["p2_full_gradient_dn"] = edge_dn if is_lower_at_edges else 0
    out["uniqueness_ratio"] = min(100, round(base["uniqueness_ratio"] * share["param-secondpeakdelta"]))
    if changed("param-leftrightthreshold"):
        out["lr_max_diff"] = math.floor(number("param-leftrightthreshold") / _LEFT_RIGHT_STEPS + 0.5)
    if number("param-texturecountthresh") > 0:
        out["min_texture_dn"] = math.ceil(_DN_OF_10_BITS * number("param-texturedifferencethresh"))
    if changed("param-usersm", "param-rsmremovethreshold", "param-rsmdiffthreshold"):
        is_used = number("param-usersm") > 0
        out["speckle_max_size"] = round(_REGION_PIXELS * number("param-rsmremovethreshold")) if is_used else 0
        out["speckle_max_diff_px"] = number("param-rsmdiffthreshold")
    for side, name in (("width", "param-regionshrinku"), ("height", "param-regionshrinkv")):
        shrink = number(name) - float(keys()[name].default)
        out[f"block_{side}"] = _odd(base[f"block_{side}"] - 2 * shrink, max(_WIDEST_BLOCK, base[f"block_{side}"]))
    out["min_disparity"] = base["min_disparity"] + round(number("aux-param-disparityshift"))
    return out


def depth_table(settings: AdvancedSettings) -> DepthTable:
    unit_m = 1e-6 * settings.number("param-depthunits")
    low, high = (settings.number(f"aux-param-depthclamp{end}") for end in ("min", "max"))
    if low >= high:
        raise ValueError(f"aux-param-depthclampmin is {low:g}, expected below aux-param-depthclampmax, {high:g}")
    return DepthTable(unit_m, low * unit_m, high * unit_m, settings.number("param-disparitymode") > 0)


def camera_fields(settings: AdvancedSettings) -> dict[str, Any]:
    """Returns {field of StereoDepthSensorConfig: value} for the file's keys of exposure and laser."""
    given, number = settings.values, settings.number
    out: dict[str, Any] = {}
    if settings.is_changed("aux-param-autoexposure-setpoint"):
        out["ir_exposure_target_dn"] = max(1.0, _DN_OF_12_BITS * number("aux-param-autoexposure-setpoint"))
    if "controls-autoexposure-auto" in given:
        is_automatic = settings.word("controls-autoexposure-auto") == "True"
        out["ir_exposure_mode"] = "settled" if is_automatic else "fixed"
    if "controls-autoexposure-manual" in given:
        out["ir_camera_exposure"] = 1e-6 * number("controls-autoexposure-manual")
    if "controls-depth-gain" in given:
        out["ir_camera_gain"] = number("controls-depth-gain") / float(keys()["controls-depth-gain"].default)
    if "controls-laserpower" in given:
        out["laser_power_mw"] = number("controls-laserpower")
    if "controls-laserstate" in given:
        out["emitter"] = "off" if settings.word("controls-laserstate") == "off" else "on"
    return out


def _odd(side: float, most: int) -> int:
    """Rounds a window's side to an odd number, between 3 and `most`."""
    return min(most, max(3, 2 * round((side - 1) / 2) + 1))
