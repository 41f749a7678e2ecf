# SPDX-License-Identifier: Apache-2.0
"""Options with ranges, as sensors and filters of pyrealsense2 have them, and the advanced mode's groups of controls
over the keys of its JSON.

Names, keys and scales are librealsense's (src/ds/advanced_mode/json_loader.hpp)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace

from activestereo.camera.advanced_mode import AdvancedSettings
from activestereo.camera.advanced_mode.settings import keys, parse_settings
from activestereo.integrations.realsense.enums import option


@dataclass
class option_range:
    min: float = 0.0
    max: float = 0.0
    step: float = 0.0
    default: float = 0.0


class Options:
    """ranges: each option's range, None for a read-only one. on_change: called before an option takes a value; it may
    refuse it."""

    def __init__(
        self,
        ranges: Mapping[option, option_range],
        read_only: Mapping[option, float] | None = None,
        on_change: Callable[[option, float], None] = lambda which, value: None,
    ) -> None:
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


@dataclass(frozen=True)
class _Field:
    """A key as a structure's number: scale times the key, or 1 minus it."""

    key: str
    scale: float = 1.0
    is_inverted: bool = False

    def from_key(self, value: float) -> float:
        return 1.0 - value if self.is_inverted else round(self.scale * value, 6)

    def key_value(self, number: float) -> float:
        return 1.0 - number if self.is_inverted else number / self.scale


def _fields(**keys: str) -> dict[str, _Field]:
    return {name: _Field(key) for name, key in keys.items()}


_REGION_PIXELS, _FULL_SCALE = 168.0, 1022.0
GROUPS: dict[str, dict[str, _Field]] = {
    "depth_control": _fields(
        plusIncrement="param-robbinsmonroincrement",
        minusDecrement="param-robbinsmonrodecrement",
        deepSeaMedianThreshold="param-medianthreshold",
        scoreThreshA="param-minscorethresha",
        scoreThreshB="param-maxscorethreshb",
        textureDifferenceThreshold="param-texturedifferencethresh",
        textureCountThreshold="param-texturecountthresh",
        deepSeaSecondPeakThreshold="param-secondpeakdelta",
        deepSeaNeighborThreshold="param-neighborthresh",
        lrAgreeThreshold="param-leftrightthreshold",
    ),
    "rsm": {
        "rsmBypass": _Field("param-usersm", is_inverted=True),
        "diffThresh": _Field("param-rsmdiffthreshold"),
        "sloRauDiffThresh": _Field("param-rsmrauslodiffthreshold"),
        "removeThresh": _Field("param-rsmremovethreshold", _REGION_PIXELS),
    },
    "rau_support_vector_control": _fields(
        minWest="param-rauminw",
        minEast="param-raumine",
        minWEsum="param-rauminwesum",
        minNorth="param-rauminn",
        minSouth="param-raumins",
        minNSsum="param-rauminnssum",
        uShrink="param-regionshrinku",
        vShrink="param-regionshrinkv",
    ),
    "color_control": _fields(
        disableSADColor="param-disablesadcolor",
        disableRAUColor="param-disableraucolor",
        disableSLORightColor="param-disableslorightcolor",
        disableSLOLeftColor="param-disablesloleftcolor",
        disableSADNormalize="param-disablesadnormalize",
    ),
    "rau_thresholds_control": {
        f"rauDiffThreshold{color}": _Field(f"param-regioncolorthreshold{color[0].lower()}", _FULL_SCALE)
        for color in ("Red", "Green", "Blue")
    },
    "slo_color_thresholds_control": _fields(
        diffThresholdRed="param-scanlineedgetaur",
        diffThresholdGreen="param-scanlineedgetaug",
        diffThresholdBlue="param-scanlineedgetaub",
    ),
    "slo_penalty_control": _fields(
        sloK1Penalty="param-scanlinep1",
        sloK2Penalty="param-scanlinep2",
        sloK1PenaltyMod1="param-scanlinep1onediscon",
        sloK2PenaltyMod1="param-scanlinep2onediscon",
        sloK1PenaltyMod2="param-scanlinep1twodiscon",
        sloK2PenaltyMod2="param-scanlinep2twodiscon",
    ),
    "hdad": _fields(lambdaCensus="param-lambdacensus", lambdaAD="param-lambdaad", ignoreSAD="ignoreSAD"),
    "color_correction": {f"colorCorrection{n}": _Field(f"aux-param-colorcorrection{n}") for n in range(1, 13)},
    "depth_table": _fields(
        depthUnits="param-depthunits",
        depthClampMin="aux-param-depthclampmin",
        depthClampMax="aux-param-depthclampmax",
        disparityMode="param-disparitymode",
        disparityShift="aux-param-disparityshift",
    ),
    "ae_control": _fields(meanIntensitySetPoint="aux-param-autoexposure-setpoint"),
    "census": _fields(uDiameter="param-censususize", vDiameter="param-censusvsize"),
    "amp_factor": _fields(a_factor="param-amplitude-factor"),
}


class ControlGroup(SimpleNamespace):
    """A group's numbers by pyrealsense2's names."""


def group_of(settings: AdvancedSettings, name: str, mode: int = 0) -> ControlGroup:
    """The group's numbers; mode 1 and 2, as librealsense's: the least and the largest ones."""
    found = {}
    for field, own in GROUPS[name].items():
        if mode == 0:
            found[field] = own.from_key(settings.number(own.key))
        else:
            found[field] = sorted(own.from_key(end) for end in keys()[own.key].range)[mode - 1]
    return ControlGroup(**found)


def with_group(settings: AdvancedSettings, name: str, group: ControlGroup) -> AdvancedSettings:
    """The settings with a group's numbers; those that are the camera's default stay as they were. Raises ValueError for
    a number out of its range."""
    new = {own.key: own.key_value(float(getattr(group, field))) for field, own in GROUPS[name].items()}
    changed = {key: value for key, value in new.items() if abs(value - settings.number(key)) > 1e-6}
    return parse_settings({**settings.values, **changed}, name) if changed else settings
