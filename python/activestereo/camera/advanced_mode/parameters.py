# SPDX-License-Identifier: Apache-2.0
"""Converts the keys of the advanced mode to the matcher's parameters, the depth image's units, and the camera's light.

Only Intel knows the D400's matcher, so keys are read against its defaults. A key with the camera's default leaves the
preset's matcher unchanged; another value scales the parameter by the same ratio."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from activestereo.camera.advanced_mode.settings import AdvancedSettings, keys

_WIDEST_WINDOW, _WIDEST_BLOCK = 9, 15
_LARGEST_PENALTY = 223
_LEFT_RIGHT_STEPS = 32  # of a pixel
_REGION_PIXELS = 168  # those around one within 13x13, which librealsense scales the share by
_DN_OF_10_BITS = 0.25
_DN_OF_12_BITS = 1 / 16


@dataclass(frozen=True)
class DepthTable:
    """Format of a depth image: metres per unit and the depths that it keeps, or disparities instead."""

    unit_m: float
    min_depth_m: float
    max_depth_m: float
    is_disparity: bool


def matcher_parameters(settings: AdvancedSettings, base: Mapping[str, Any]) -> dict[str, Any]:
    """simsense's parameters: `base`, the camera's preset for images of 8 bits, changed by the settings."""
    out = dict(base)
    changed, number = settings.is_changed, settings.number
    for side, name in (("width", "param-censususize"), ("height", "param-censusvsize")):
        out[f"census_{side}"] = _odd(base[f"census_{side}"] * _share(settings, name), _WIDEST_WINDOW)
    p2 = max(2, round(base["p2"] * _share(settings, "param-scanlinep2")))
    out["p2"] = min(_LARGEST_PENALTY, p2)
    out["p1"] = min(out["p2"] - 1, max(1, round(base["p1"] * _share(settings, "param-scanlinep1"))))
    if changed("param-scanlinep2", "param-scanlinep2onediscon", "param-scanlineedgetaug"):
        is_lower_at_edges = number("param-scanlinep2onediscon") < number("param-scanlinep2")
        edge_dn = max(1, round(_DN_OF_10_BITS * number("param-scanlineedgetaug")))
        out["p2_full_gradient_dn"] = edge_dn if is_lower_at_edges else 0
    out["uniqueness_ratio"] = min(100, round(base["uniqueness_ratio"] * _share(settings, "param-secondpeakdelta")))
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
    """Fields of StereoDepthSensorConfig for exposure and laser, of the keys that were given."""
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


def _share(settings: AdvancedSettings, name: str) -> float:
    """A key's number over the camera's default."""
    return settings.number(name) / float(keys()[name].default)


def _odd(side: float, most: int) -> int:
    """The nearest odd number, 3 at least."""
    return min(most, max(3, 2 * round((side - 1) / 2) + 1))
