# SPDX-License-Identifier: Apache-2.0
"""Checks the fields of a sensor's configuration: each one when it is set, and all together when a sensor is made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from os import PathLike
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

import kuafu
import simsense
from activestereo.common.lens import LENGTHS
from activestereo.common.limits import (
    ANY,
    DISTORTION,
    EXPOSURE,
    FOCAL,
    GAIN,
    LASER,
    LENGTH,
    LINE_TIME,
    PIXEL,
    POWER,
    SIDE,
    SPEED,
    TEMPERATURE,
    TURN_RATE,
    Limits,
    camera_matrix_fault,
)
from activestereo.common.parameter import MATCHER, OPTICS, RENDER, RENDERER, RIG, SIGNAL, Parameter
from activestereo.common.pattern import PatternDesign
from activestereo.common.pose import Pose
from activestereo.common.shown import did_you_mean, nearest, shown

# {camera: (resolution, its matrix, a copy of the matrix)}, set together.
Calibrated: TypeAlias = "Mapping[str, tuple[tuple[int, int], NDArray[np.float64], NDArray[np.float64]]]"
_TABLE = {p.name: p for p in (*MATCHER, *RIG, *RENDERER, *RENDER)}
_NEUTRAL_OPTICS = kuafu.Optics()
# Fields that hold an engine's parameters by name: numbers, and lengths of the lists.
_IMAGER: tuple[dict[str, Parameter], dict[str, int]] = {p.name: p for p in SIGNAL}, {}
_OPTICS = (
    {p.name: p for p in OPTICS},
    {name: len(value) for name in dir(_NEUTRAL_OPTICS) if isinstance(value := getattr(_NEUTRAL_OPTICS, name), tuple)},
)
# Sides of the matcher's windows. Their products are at most 65 and 256.
_WINDOWS = {"census_width": 65, "census_height": 65, "block_width": 255, "block_height": 255}
# Fields in which infinity means no limit.
_ENDLESS = ("max_depth_m",)
_SHARE = Limits(0.0, 1.0)
_PENALTY = Limits(1, 223, whole=True)
_COUNTS = Limits(-65535.0, 65535.0, "DN")
_LASER = Limits(0.0, LASER.high, "mW")  # 0: off
_SEED = Limits(0, 2**64 - 1, whole=True)
# The upper half of a picture's seed; its number is the lower one.
RENDER_SEED = Limits(0, 2**32 - 1, whole=True)
FRAME = Limits(-1, 2**32 - 2, whole=True)
_NUMBERS = {
    "active_light_fov": Limits(1e-3, 3.14, "rad"),
    "light_dot_background": _SHARE,
    "light_pattern_scale": Limits(1e-3, 1e3),
    "projector_intensity": Limits(0.0, 1e6, "W/sr"),
    "laser_power_mw": _LASER,
    "laser_power_nominal_mw": LASER,
    "projector_beam_radius_m": Limits(0.0, 0.1, "m"),
    "projector_falloff": Limits(0.0, 64.0),
    "ir_camera_exposure": EXPOSURE,
    "ir_camera_gain": GAIN,
    "ir_exposure_target_dn": Limits(0.0, 65535.0, "DN"),
    "ir_responsivity_dn": Limits(1e-6, 1e12, "DN per W s / (sr m^2)"),
    "rgb_exposure": Limits(0.0, 1e12),
    "rgb_exposure_s": Limits(0.0, 100.0, "s"),
    "ir_line_time_s": LINE_TIME,
    "rgb_line_time_s": LINE_TIME,
    "ir_black_level_dn": _COUNTS,
    "ir_speckle_noise": POWER,
    "ir_thermal_noise": POWER,
    "noise_seed": _SEED,
    "render_seed": RENDER_SEED,
    "p1": _PENALTY,
    "p2": _PENALTY,
}
_LISTS = {
    "rgb_resolution": [SIDE] * 2,
    "ir_resolution": [SIDE] * 2,
    "laser_power_limits_mw": [_LASER] * 3,
    "ir_exposure_limits_s": [Limits(EXPOSURE.low, 100.0, "s")] * 2,
    "ir_gain_limits": [GAIN] * 2,
    "ir_exposure_region": [Limits(0, 65535, "px", whole=True)] * 4,
}
_LENSES = ("ir_distortion", "ir_distortion_right", "rgb_distortion")
_POSES = ("trans_pose_l", "trans_pose_r", "pose_rgb_irproj")
_MATRICES = ("rgb_intrinsic", "ir_intrinsic", "ir_intrinsic_right", "pattern_intrinsic")
Emitter = Literal["on", "off", "alternating"]
ExposureMode = Literal["fixed", "converging", "settled"]
Readout = Literal["rows_down", "rows_up", "columns_right", "columns_left"]
_CHOICES: dict[str, tuple[str, ...]] = {
    "emitter": get_args(Emitter),
    "ir_exposure_mode": get_args(ExposureMode),
    "ir_readout": get_args(Readout),
    "rgb_readout": get_args(Readout),
}
_FLAGS = ("rectified", "ir_speckle_of_laser", "projector_always_on")
# Maps that a sensor may give besides depth: the depth engine's outputs.
DEPTH_MAPS = ("confidence", "reason", "points", "rectified_left", "rectified_right")
_MAY_BE_NONE = ("rgb_exposure", "ir_exposure_region", "ir_distortion_right", "ir_intrinsic_right", "pattern_intrinsic")


def check_field(name: str, value: Any) -> None:
    """Checks one field's value. Raises ValueError with the value and the allowed values if it is invalid."""
    if (fault := None if value is None and name in _MAY_BE_NONE else _fault(name, value)) is not None:
        raise ValueError(f"{name} {fault}")


def _fault(name: str, value: Any) -> str | None:
    """Returns None if a field's value is valid. Otherwise returns the fault as text that follows the field's name."""
    if name in _NUMBERS:
        return _NUMBERS[name].fault(value)
    if name in _LISTS:
        return _list_fault(value, _LISTS[name])
    if name in _WINDOWS:
        fault = Limits(1, _WINDOWS[name], "px", whole=True).fault(value)
        is_even = fault is None and not value % 2
        return f"is {value}, expected an odd number, 1 to {_WINDOWS[name]} px" if is_even else fault
    if name in _TABLE:
        return _parameter_fault(_TABLE[name], value)
    if name in _CHOICES and value not in _CHOICES[name]:
        return f"is {shown(value)} (known: {', '.join(_CHOICES[name])})"
    if name in _FLAGS:
        return _flag_fault(value)
    if name in _LENSES:
        count = np.size(value)
        if count not in LENGTHS:
            return f"is {shown(value)}, expected 5 numbers, 8 of a rational lens or 4 of a fisheye lens"
        return _list_fault(value, [DISTORTION] * count)
    if name in _MATRICES:
        return _matrix_fault(value)
    if name in _POSES:
        if not isinstance(value, Pose):
            return f"is a {type(value).__name__}, expected a Pose"
        return _list_fault(value.p.tolist(), [LENGTH] * 3)
    if name in ("ir_optics", "rgb_optics"):
        return _record_fault(value, *_OPTICS)
    if name == "ir_signal":
        if not isinstance(value, str):
            return _record_fault(value, *_IMAGER)
        simsense.signal_preset(value[:40])  # type: ignore[arg-type]  # the engine knows them, all shorter, and says so
    elif name == "depth_maps":
        return _names_fault(value, DEPTH_MAPS)
    elif name == "light_dots":
        return _dots_fault(value)
    elif name == "light_pattern" and isinstance(value, np.ndarray):
        is_image = value.ndim == 2 and value.size > 0 and value.dtype == np.uint8
        return None if is_image else f"is {value.dtype} {list(value.shape)}, expected uint8 [height, width]"
    elif name == "light_pattern" and not (value is None or isinstance(value, (str, PathLike))):
        return f"is {shown(value)}, expected 'generated', an image, the path of one, or None"
    elif name == "pattern_design" and not isinstance(value, PatternDesign):
        return f"is {shown(value)}, expected a PatternDesign"
    return None


def _parameter_fault(p: Parameter, value: Any) -> str | None:
    known = f"(known: {', '.join(p.choices)})"
    if value is None and p.default is None:
        return None
    if p.kind is tuple:
        return _names_fault(value if isinstance(value, (tuple, list)) else (value,), p.choices)
    if p.choices:
        return None if value in p.choices else f"is {shown(value)} {known}"
    if p.kind is bool:
        return _flag_fault(value)
    if p.kind is str or (p.name in _ENDLESS and value == inf):
        return None
    if p.unit == "deg C":
        return TEMPERATURE.fault(value)
    low, high = p.range or (ANY.low, ANY.high)
    whole = p.kind is int
    limits = Limits(-(2**53) if whole else max(low, ANY.low), 2**53 if whole else min(high, ANY.high), p.unit, whole)
    fault, may_be = limits.fault(value), f"{p.possible or f'{low:.10g} to {high:.10g}'} {p.unit}".rstrip()
    if fault is None and not p.takes(value):
        return f"is {value}, expected {may_be}"
    return f"{fault.partition(',')[0]}, expected a whole number, {may_be}" if fault is not None and whole else fault


def _flag_fault(value: Any) -> str | None:
    is_flag = isinstance(value, (bool, int, np.bool_)) and value in (True, False)
    return None if is_flag else f"is {shown(value)}, expected True or False"


def _names_fault(names: Any, known: Sequence[str]) -> str | None:
    if not isinstance(names, (tuple, list)):
        return f"is {shown(names)}, expected names out of {', '.join(known)}"
    odd = [one for one in names if one not in known]
    return f"has {shown(odd[0])} (known: {', '.join(known)}){did_you_mean(odd[0], known)}" if odd else None


def _record_fault(values: Any, table: Mapping[str, Parameter], lengths: Mapping[str, int]) -> str | None:
    if values is None:
        return None
    if not isinstance(values, Mapping):
        return f"is {shown(values)}, expected {{parameter: value}}"
    known = (*table, *lengths)
    for name, value in values.items():
        if name in table:
            fault = _parameter_fault(table[name], value)
        elif name in lengths:
            fault = _list_fault(value, [ANY] * lengths[name])
        else:
            near = next((other for other in known if other.startswith(str(name))), nearest(name, known))
            return f"has no parameter {shown(name)}" + (f": did you mean '{near}'?" if near else "")
        if fault is not None:
            return f"[{shown(name)}] {fault}"
    return None


def _dots_fault(dots: Any) -> str | None:
    if dots is None:
        return None
    try:
        table = np.asarray(dots, np.float64)
    except (TypeError, ValueError, OverflowError):
        table = np.empty(0)
    if table.ndim != 2 or table.shape[1] != 3 or not len(table):
        return f"has the shape {list(table.shape)}, expected [dots, 3]: u, v and power"
    is_right = (np.abs(table) <= PIXEL.high).all(axis=1) & (table[:, 2] >= 0)  # false for NaN, too
    if is_right.all():
        return None
    first = int(np.argmin(is_right))
    return f"[{first}] is {table[first].tolist()}, expected u and v in pixels and a power of 0 or more"


def _list_fault(values: Any, limits: Sequence[Limits]) -> str | None:
    if isinstance(values, str) or np.shape(values) != (len(limits),):
        return f"is {shown(values)}, expected {len(limits)} numbers"
    faults = [f"[{i}] {fault}" for i, value in enumerate(values) if (fault := limits[i].fault(value)) is not None]
    return faults[0] if faults else None


def _matrix_fault(value: Any) -> str | None:
    try:
        k = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        k = np.empty(0)
    if k.shape != (3, 3):
        return f"is {shown(value)}, expected a 3x3 camera matrix"
    for name, limits, entry in (
        ("fx", FOCAL, k[0, 0]), ("fy", FOCAL, k[1, 1]), ("skew", PIXEL, k[0, 1]),
        ("cx", PIXEL, k[0, 2]), ("cy", PIXEL, k[1, 2]),
    ):  # fmt: skip
        if (fault := limits.fault(float(entry))) is not None:
            return f"{name} {fault}"
    return camera_matrix_fault(k)


def check_matrix(name: str, k: Any, fields: Mapping[str, Any]) -> None:
    """Checks a 3x3 camera matrix `k` for the field `name`. Raises ValueError if it does not fit the camera's resolution
    in `fields`."""
    camera = name.partition("_")[0]
    if k is not None and name != "pattern_intrinsic":
        width, height = fields[f"{camera}_resolution"]
        _check_middle(name, np.asarray(k), width, height, f"set {camera}_resolution first")


def check_together(fields: Mapping[str, Any]) -> None:
    """Raises ValueError if a value is invalid or fields contradict one another. fields: vars() of a configuration. Each
    value is checked again, since an array may have been changed in place."""
    for name, value in fields.items():
        check_field(name, value)
    calibrated: Calibrated = fields["_calibrated"]
    for camera in ("rgb", "ir"):
        width, height = fields[f"{camera}_resolution"]
        remedy = f"take config.scaled(factor), or set {camera}_intrinsic to that of {width}x{height}"
        size, k, as_it_was = calibrated[camera]
        if (width, height) != size and k is fields[f"{camera}_intrinsic"] and np.array_equal(k, as_it_was):
            still = f"{camera}_intrinsic is still {size[0]}x{size[1]}'s"
            raise ValueError(f"{camera}_resolution is {width}x{height}, but {still}: {remedy}")
        _check_middle(f"{camera}_intrinsic", fields[f"{camera}_intrinsic"], width, height, remedy)
    if fields["ir_intrinsic_right"] is not None:
        _check_middle("ir_intrinsic_right", fields["ir_intrinsic_right"], width, height, remedy)
    # Laser, noise and automatic exposure.
    (low, high, _), power_mw = fields["laser_power_limits_mw"], fields["laser_power_mw"]
    if not low <= power_mw <= high:
        raise ValueError(f"laser_power_mw is {power_mw:g}, expected {low:g} to {high:g}")
    if power_mw > 0.0:
        LASER.check("laser_power_mw", power_mw)
    speckle, thermal = fields["ir_speckle_noise"], fields["ir_thermal_noise"]
    if fields["ir_signal"] is None and speckle > 0 and thermal <= 0:
        raise ValueError(
            f"noise scales must be positive, or ir_speckle_noise 0 for none; they are {speckle} and {thermal}"
        )
    if fields["ir_signal"] is not None and (speckle, thermal) != (1.0, 1.0):
        raise ValueError(
            f"ir_speckle_noise is {speckle:g} and ir_thermal_noise {thermal:g}, but ir_signal states the noise: "
            "change its terms, or set it to None"
        )
    if fields["ir_exposure_mode"] != "fixed":
        _check_automatic_exposure(fields)
    # The engine refuses these combinations of matcher parameters.
    if not fields["p1"] < fields["p2"]:
        raise ValueError(f"p1 is {fields['p1']} and p2 is {fields['p2']}, expected a larger p2")
    if not fields["min_depth_m"] < fields["max_depth_m"]:
        low, high = fields["min_depth_m"], fields["max_depth_m"]
        raise ValueError(f"min_depth_m is {low:g}, expected less than max_depth_m, {high:g}")
    for name, least, most in (("census", 3, 63 if fields["census_kind"] == "plain" else 65), ("block", 1, 256)):
        width, height = fields[f"{name}_width"], fields[f"{name}_height"]
        if not least <= width * height <= most:
            raise ValueError(f"{name} is {width}x{height} pixels, expected {least} to {most} pixels in all")


def _check_automatic_exposure(fields: Mapping[str, Any]) -> None:
    """Checks the fields of automatic exposure. Raises ValueError if limits, target or region are impossible."""
    for name in ("ir_exposure_limits_s", "ir_gain_limits"):
        low, high = fields[name]
        if low > high:
            raise ValueError(f"{name} is {low:g} to {high:g}, expected two numbers above 0 in order")
    target_dn, black_dn = fields["ir_exposure_target_dn"], fields["ir_black_level_dn"]
    if not black_dn < target_dn:
        raise ValueError(f"ir_exposure_target_dn is {target_dn:g}, expected more than the black level, {black_dn:g}")
    if (region := fields["ir_exposure_region"]) is not None:
        (left, top, right, bottom), (width, height) = region, fields["ir_resolution"]
        if not (0 <= left < right <= width and 0 <= top < bottom <= height):
            raise ValueError(
                f"ir_exposure_region {tuple(region)} is not inside of {width}x{height} (left, top, right, bottom)"
            )


def _check_middle(name: str, k: NDArray[np.float64], width: int, height: int, remedy: str) -> None:
    cx, cy = k[0, 2], k[1, 2]
    if abs(cx - 0.5 * (width - 1)) > 0.25 * width or abs(cy - 0.5 * (height - 1)) > 0.25 * height:
        raise ValueError(
            f"{name} has its principal point at ({cx:g}, {cy:g}), expected within a quarter of {width}x{height} from "
            f"the middle, as it is of another resolution: {remedy}"
        )


def checked_twist(linear: ArrayLike, angular: ArrayLike) -> NDArray[np.float64]:
    """Returns the twist [v, w] (6, m/s and rad/s) of a linear and an angular velocity. Raises ValueError if one is
    beyond the limits."""
    parts = (("linear velocity in m/s", linear, SPEED), ("angular velocity in rad/s", angular, TURN_RATE))
    for name, part, limits in parts:
        if (fault := _list_fault(np.asarray(part).tolist(), [limits] * 3)) is not None:
            raise ValueError(f"the {name} {fault}")
    return np.concatenate([linear, angular]).astype(np.float64)
