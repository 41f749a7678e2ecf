# SPDX-License-Identifier: Apache-2.0
"""Sets materials from measured reflectances; one table gives the colour for the RGB camera and the albedo for the
infrared cameras.

A CSV file has a column `wavelength_nm`, ascending, and one column for each measured material of the scene:

    wavelength_nm,wood,steel
    400,0.08,0.52
    ...
    900,0.55,0.61

The visible colour is that of the reflectance under light of equal energy, seen by the CIE 1931 observer and converted
to linear sRGB so that a reflectance of 1 is white. The infrared albedo is the reflectance at the wavelength of the
sensor's laser."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from activestereo.common.input_files import read_text

if TYPE_CHECKING:
    import kuafu

VISIBLE_NM = (400.0, 700.0)  # range that a table must cover; the observer sees 0.2 % beyond
INFRARED_NM = 850.0  # the laser of a RealSense D400
_XYZ_TO_SRGB = np.array(  # IEC 61966-2-1
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)
# Weight, wavelength of the peak, widths below and above it: Wyman, Sloan and Shirley, "Simple Analytic Approximations
# to the CIE XYZ Color Matching Functions", JCGT 2013.
_OBSERVER = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)


class ReflectanceError(ValueError):
    """Raised if a table of reflectances is unusable. The message has the file, the place and the remedy."""


@dataclass(frozen=True)
class Reflectance:
    """The share of light that a surface reflects, by wavelength."""

    wavelengths_nm: NDArray[np.float64]  # [n], ascending
    values: NDArray[np.float64]  # [n], 0 to 1

    def linear_rgb(self) -> NDArray[np.float64]:
        """Computes the colour under light of equal energy, linear sRGB [3]; colours outside sRGB are clipped to
        0..1."""
        nm = np.arange(360.0, 781.0)
        observer = [
            sum(w * np.exp(-0.5 * ((nm - peak) / np.where(nm < peak, low, high)) ** 2) for w, peak, low, high in lobes)
            for lobes in _OBSERVER
        ]
        to_rgb = _XYZ_TO_SRGB @ np.array(observer)
        rgb = to_rgb @ np.interp(nm, self.wavelengths_nm, self.values) / to_rgb.sum(axis=1)
        return np.asarray(np.clip(rgb, 0.0, 1.0))


def read_reflectances(path: str | Path, infrared_nm: float = INFRARED_NM) -> dict[str, Reflectance]:
    """Reads a table as {material name: Reflectance}. infrared_nm: a wavelength that it must cover. Raises
    ReflectanceError."""
    try:
        rows = [row for row in csv.reader(io.StringIO(read_text(path), newline="")) if row]
    except (OSError, ValueError, csv.Error) as error:
        raise ReflectanceError(f"{path}: cannot be read: {error}") from error
    if len(rows) < 3 or rows[0][0].strip() != "wavelength_nm" or len(rows[0]) < 2:
        raise ReflectanceError(f"{path}: needs a first line wavelength_nm,NAME,... and at least two lines of numbers")
    names = [name.strip() for name in rows[0][1:]]
    if len(set(names)) != len(names):
        raise ReflectanceError(f"{path}: a material is there twice: {', '.join(names)}")
    table = []
    for line, row in enumerate(rows[1:], start=2):
        try:
            values = [float(text) for text in row]
        except ValueError as error:
            raise ReflectanceError(f"{path}: line {line}: {error}") from error
        if len(values) != len(names) + 1:
            raise ReflectanceError(
                f"{path}: line {line} has {len(values)} numbers, the first line names {len(names) + 1}"
            )
        if not all(0.0 <= value <= 1.0 for value in values[1:]) or not np.isfinite(values[0]):
            raise ReflectanceError(f"{path}: line {line}: reflectances must be from 0 to 1 (not percent)")
        table.append(values)
    numbers = np.array(table)
    nm = numbers[:, 0]
    if not (np.diff(nm) > 0).all():
        raise ReflectanceError(f"{path}: wavelengths must ascend")
    low, high = min(VISIBLE_NM[0], infrared_nm), max(VISIBLE_NM[1], infrared_nm)
    if nm[0] > low or nm[-1] < high:
        raise ReflectanceError(f"{path}: covers {nm[0]:g} to {nm[-1]:g} nm, must cover {low:g} to {high:g}")
    return {name: Reflectance(nm, numbers[:, 1 + i]) for i, name in enumerate(names)}


def apply_reflectances(
    scene: kuafu.Scene, table: dict[str, Reflectance], infrared_nm: float = INFRARED_NM
) -> list[str]:
    """Sets the measured colour and infrared albedo of the scene's materials by name, in place of base colours and
    textures. Returns the names of the changed materials. Raises ReflectanceError for a name that the scene lacks."""
    materials = [scene.get_material(number) for number in range(scene.summary.material_count)]
    known = sorted(material.name for material in materials)
    if missing := sorted(set(table) - set(known)):
        raise ReflectanceError(f"no material is called {', '.join(missing)}; the scene has {', '.join(known)}")
    found: list[str] = []
    for number, material in enumerate(materials):
        if material.name not in table:
            continue
        measured = table[material.name]
        red, green, blue = (float(value) for value in measured.linear_rgb())
        material.base_color = (red, green, blue, material.base_color[3])
        material.ir_albedo = float(np.interp(infrared_nm, measured.wavelengths_nm, measured.values))
        material.base_color_texture = material.ir_albedo_texture = None
        scene.set_material(number, material)
        found.append(material.name)
    return found
