# SPDX-License-Identifier: Apache-2.0
"""The advanced mode's groups of controls, as pyrealsense2's structures have them, over the keys of its JSON.

Names, keys and scales are librealsense's (src/ds/advanced_mode/json_loader.hpp)."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

from activestereo.camera.advanced_mode import AdvancedSettings
from activestereo.camera.advanced_mode.settings import keys, parse_settings


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


def _fields(**of_keys: str) -> dict[str, _Field]:
    return {name: _Field(key) for name, key in of_keys.items()}


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
