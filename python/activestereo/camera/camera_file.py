# SPDX-License-Identifier: Apache-2.0
"""Reads camera data from TOML files. Every figure has its source, and the table below checks it.

name = "D435i"
title = "Intel RealSense D435i"
based_on = "d435"            # another file of the same folder, for figures that this one lacks

[imager]
black_level_dn = { value = 17.0, basis = "measured", source = "least counts of D435i recordings" }
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from activestereo.common.input_files import read_toml
from activestereo.common.limits import Limits
from activestereo.common.nearest import did_you_mean
from activestereo.common.parameter import MATCHER, OPTICS, RENDER, SIGNAL, Parameter

FOLDER = Path(__file__).parent / "data"
BASES = ("data sheet", "measured", "published", "derived", "estimated")
_LONGEST_CHAIN = 8


@dataclass(frozen=True)
class Field:
    """The range of a figure: `count` numbers (0: one, not a list) within low..high, or one of `choices`."""

    doc: str
    unit: str = ""
    count: int = 0
    low: float = -inf
    high: float = inf
    choices: tuple[Any, ...] = ()
    whole: bool = False
    or_zero: bool = False


def _numbers(doc: str, unit: str, count: int = 0, low: float = -inf, high: float = inf, whole: bool = False) -> Field:
    return Field(doc, unit, count, low, high, whole=whole)


def _engine(table: Sequence[Parameter], *names: str, least: float = -inf, most: float = inf) -> dict[str, Field]:
    """Figures of an engine's parameters, from its table. least, most: narrower bounds for a camera."""
    rows = {p.name: p for p in table}
    return {name: _engine_field(rows[name], least, most) for name in names}


def _engine_field(p: Parameter, least: float, most: float) -> Field:
    low, high = p.range or (-inf, inf)
    low, high = max(low, least), min(high, most)
    whole = p.kind is int
    doc, choices = p.doc.split(". ")[0].rstrip("."), p.choices or p.allowed
    return Field(doc, p.unit, low=low, high=high, choices=choices, whole=whole, or_zero=p.or_zero)


# section: {figure: allowed values}. Positions are in the RGB camera's body frame (x forward, y left, z up).
FIELDS: dict[str, dict[str, Field]] = {
    "rig": {
        "ir_resolution": _numbers("width and height of the infrared images", "px", 2, 32, 65535, whole=True),
        "ir_intrinsic": _numbers("fx, fy, cx, cy of both infrared cameras", "px", 4, -1e6, 1e6),
        "rgb_resolution": _numbers("width and height of the RGB picture", "px", 2, 32, 65535, whole=True),
        "rgb_intrinsic": _numbers("fx, fy, cx, cy of the RGB camera", "px", 4, -1e6, 1e6),
        "ir_rotation": _numbers("3x3, row-major: infrared cameras and projector against the RGB camera", "", 9, -1, 1),
        "left_position_m": _numbers("left infrared camera", "m", 3, -10, 10),
        "right_position_m": _numbers("right infrared camera", "m", 3, -10, 10),
        "projector_position_m": _numbers("projector", "m", 3, -10, 10),
        **_engine(MATCHER, "min_depth_m", "max_depth_m", least=0.0, most=1e6),
        **_engine(MATCHER, "max_disparity"),
        "line_time_s": _numbers("rolling shutter of the infrared cameras, 0 = global", "s", 0, 0, 1),
    },
    "projector": {
        "has_projector": Field("whether there is one", choices=(True, False)),
        "field_of_view_deg": _numbers("width of the pattern image", "deg", 0, 1, 170),
        "pattern_size": _numbers("width and height of the pattern image", "px", 2, 16, 16384, whole=True),
        "dot_pitch_px": _numbers("side of the cell that holds one dot, of the pattern image", "px", 0, 2, 1000),
        "lattice_angles_deg": _numbers("of two square lattices of dots, of that pitch", "deg", 2, 0, 90),
        "dot_sigma_px": _numbers("sigma of a dot, of the pattern image", "px", 0, 0.1, 100),
        "weakest_dot": _numbers("power of the weakest dot over the strongest's", "", 0, 0, 1),
        "background": _numbers("light between the dots over the strongest dot's", "", 0, 0, 1),
        "pattern_seed": _numbers("which pattern", "", 0, 0, 2**31, whole=True),
        "intensity_w_sr": _numbers("strongest dot at laser_power_mw", "W/sr", 0, 0, 1e6),
        "laser_power_mw": _numbers("the setting as it comes", "mW", 0, 1e-3, 1e6),
        "laser_power_limits_mw": _numbers("least and largest setting, and the step", "mW", 3, 0, 1e6),
        "beam_radius_m": _numbers("of a dot's beam where it leaves the projector", "m", 0, 0, 0.1),
        "falloff": _numbers("dots fall with this power of the cosine from the axis", "", 0, 0, 64),
    },
    "exposure": {
        "mode": Field("how exposure and gain are found", choices=("fixed", "settled", "converging")),
        "exposure_s": _numbers("exposure, or the first one", "s", 0, 1e-7, 100),
        "exposure_limits_s": _numbers("automatic exposure stays within", "s", 2, 1e-7, 100),
        "gain": _numbers("gain, or the first one", "", 0, 1e-3, 1e6),
        "gain_limits": _numbers("automatic gain stays within", "", 2, 1e-3, 1e6),
        "target_dn": _numbers("mean count that automatic exposure aims at", "DN", 0, 1, 65535),
    },
    "imager": {
        "responsivity_dn": _numbers("counts per W s / (sr m^2) at gain 1", "DN", 0, 1e-6, 1e12),
        "speckle_contrast": _numbers("laser speckle's standard deviation over its mean", "", 0, 0, 1),
        **_engine(SIGNAL, "black_level_dn", "adc_noise_dn", least=-1000.0, most=65535.0),
        **_engine(SIGNAL, "speckle_correlation", "speckle_psf_sigma_px"),
        **_engine(SIGNAL, "conversion_gain_dn_per_e", least=1e-6, most=1e6),
        **_engine(SIGNAL, "prnu", most=1.0),
    },
    "optics": _engine(OPTICS, "vignetting_exponent", "psf_sigma_px", "firefly_factor"),
    "room": {
        **_engine(RENDER, "ir_ambient_scale", most=100.0),
        **_engine(RENDER, "ir_ambient_radiance", most=1e6),
        **_engine(RENDER, "denoise"),
    },
    "matcher": _engine(
        MATCHER, "block_width", "block_height", "census_contrast", "p1", "p2", "p2_full_gradient_dn",
        "uniqueness_ratio", "subpixel", "median_size", "min_texture_dn", "min_correlation", "speckle_max_size",
        "edge_step_px", "right_border_px",
    ),  # fmt: skip
}


@dataclass(frozen=True)
class Figure:
    """A value, its basis (one of BASES) and its source."""

    value: Any
    basis: str
    source: str


@dataclass(frozen=True)
class CameraData:
    """figures: {section: {name: Figure}}, including those of the files that it is based on."""

    name: str
    title: str
    figures: dict[str, dict[str, Figure]]

    def value(self, section: str, name: str, default: Any = None) -> Any:
        figure = self.figures.get(section, {}).get(name)
        if figure is None:
            if default is None:
                raise ValueError(f"camera {self.name}: {section}.{name} is missing")
            return default
        return figure.value


def camera_names() -> list[str]:
    """Names of the known cameras' files."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_camera(name: str | Path) -> CameraData:
    """Reads a camera by its name (in any case) or the path of a file. Raises ValueError with the figure and its
    fault."""
    path = FOLDER / f"{str(name).lower()}.toml"
    if not path.is_file() or "/" in str(name):
        path = Path(name)
        if path.suffix != ".toml":
            titles = camera_titles()
            known = f"known: {', '.join(titles)}, or the path of a .toml file"
            raise ValueError(f"unknown sensor '{name}' ({known}){did_you_mean(name, titles)}")
    return _read(path, _LONGEST_CHAIN)


def camera_titles() -> list[str]:
    """Titles in the known cameras' files."""
    return [read_toml(FOLDER / f"{name}.toml")["name"] for name in camera_names()]


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
        beside = beside if beside.is_file() else FOLDER / f"{base}.toml"
        figures = {section: dict(entries) for section, entries in _read(beside, chain - 1).figures.items()}
    texts = {key: content.pop(key, None) for key in ("name", "title")}
    for key, text in texts.items():
        if not isinstance(text, str) or not text:
            raise ValueError(f"{path}: {key}: is {text!r}, expected text")
    for section, entries in content.items():
        _known(path, "section", section, FIELDS)
        if not isinstance(entries, dict):
            raise ValueError(f"{path}: {section}: is {entries!r}, expected a section of figures")
        for key, entry in entries.items():
            _known(path, f"figure of {section}", key, FIELDS[section])
            figures[section][key] = _figure(f"{path}: {section}.{key}", entry, FIELDS[section][key])
    return CameraData(str(texts["name"]), str(texts["title"]), figures)


def _known(path: Path, kind: str, name: str, known: dict[str, Any]) -> None:
    if name not in known:
        hint = did_you_mean(name, known) or f"; known: {', '.join(known)}"
        raise ValueError(f"{path}: '{name}' is no {kind}{hint}")


def _figure(place: str, entry: Any, field: Field) -> Figure:
    if not isinstance(entry, dict) or set(entry) != {"value", "basis", "source"}:
        raise ValueError(f"{place}: expected {{ value = ..., basis = ..., source = ... }}, not {entry!r}")
    if entry["basis"] not in BASES:
        raise ValueError(f"{place}: basis is {entry['basis']!r}, expected one of {', '.join(BASES)}")
    if not isinstance(entry["source"], str) or not entry["source"].strip():
        raise ValueError(f"{place}: source is empty: say where the figure comes from")
    return Figure(_value(place, entry["value"], field), entry["basis"], entry["source"])


def _value(place: str, value: Any, field: Field) -> Any:
    if field.choices:
        if value not in field.choices or isinstance(value, bool) != isinstance(field.choices[0], bool):
            raise ValueError(f"{place}: is {value!r}, expected one of {', '.join(map(repr, field.choices))}")
        return value
    if field.count and (not isinstance(value, list) or len(value) != field.count):
        raise ValueError(f"{place}: is {value!r}, expected {field.count} numbers")
    parts: Sequence[Any] = value if field.count else [value]
    for part in parts:
        low = min(field.low, 0.0) if field.or_zero and part == 0 else field.low
        fault = Limits(low, field.high, field.unit, field.whole).fault(part)
        if fault is not None:
            raise ValueError(f"{place}: {fault}")
    return value
