# SPDX-License-Identifier: Apache-2.0
"""Reads the output of `rs-enumerate-devices -c` for one device: intrinsics of every stream and mode, and extrinsics
between streams.

    Intrinsic of "Infrared 1" / 848x480 / {Y8}         Extrinsic from "Infrared 1"  To  "Infrared 2" :
      Width:  848                                       Rotation Matrix:
      PPX:    425.16                                      1  0  0 ...
      Fx:     430.14                                    Translation Vector: -0.04995  0  0
      Distortion: Brown Conrady
      Coeffs:  0 0 0 0 0

An extrinsic maps coordinates in the first stream to those in the second; the right camera's x is minus the baseline."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Camera
from activestereo.capture.importers.frames import INFRARED
from activestereo.common.input_files import read_text
from activestereo.common.pose import printed_motion, rigid_motion

_INTRINSIC = re.compile(r'Intrinsic of\s+"(?P<stream>[^"]+)"\s*/\s*(?P<width>\d+)x(?P<height>\d+)')
_EXTRINSIC = re.compile(r'Extrinsic from\s+"(?P<first>[^"]+)"\s+To\s+"(?P<second>[^"]+)"', re.IGNORECASE)
_FIELD = re.compile(r"^\s*(?P<key>Width|Height|PPX|PPY|Fx|Fy|Distortion|Coeffs)\s*:\s*(?P<value>.*)$")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
# These of librealsense's distortion models have Brown and Conrady's five numbers. "Inverse" means that the images are
# distorted already.
_BROWN = ("brown conrady", "modified brown conrady", "none", "inverse brown conrady")


@dataclass(frozen=True)
class DeviceText:
    """A device's calibration. intrinsics: {(stream, width, height): Camera}. extrinsics: {(a, b): 4x4 a_to_b} of two
    streams."""

    path: Path
    intrinsics: dict[tuple[str, int, int], Camera]
    extrinsics: dict[tuple[str, str], NDArray[np.float64]]

    @classmethod
    def of_pair(cls, path: Path, lenses: Sequence[Camera], left_to_right: NDArray[np.float64] | float) -> DeviceText:
        """Makes a calibration of the two infrared cameras alone. left_to_right: 4x4, or for rectified cameras the
        baseline in metres."""
        if isinstance(left_to_right, float):
            left_to_right = rigid_motion((-left_to_right, 0.0, 0.0))
        modes = {(side, lens.width, lens.height): lens for side, lens in zip(INFRARED, lenses, strict=True)}
        return cls(path, modes, {INFRARED: left_to_right})

    def intrinsic(self, stream: str, width: int, height: int) -> Camera:
        """Returns a stream's camera for images of this size. Raises ValueError, which lists the known sizes."""
        found = self.intrinsics.get((stream, width, height))
        if found is None:
            known = [(w, h) for s, w, h in self.intrinsics if s == stream]
            modes = ", ".join(f"{w}x{h}" for w, h in known) or "none"
            scaled = next((f"{w}x{h}" for w, h in known if w * height == h * width), None)
            hint = f"; were they rescaled from {scaled}? then give --k, scaled along" if scaled else ""
            raise ValueError(
                f'{self.path}: Intrinsic of "{stream}": none for the images\' {width}x{height} '
                f"(there are: {modes}){hint}"
            )
        return found

    def left_to_right(self) -> NDArray[np.float64]:
        """Returns the 4x4 from the left to the right infrared camera. Raises ValueError if the cameras are swapped."""
        motion = self.extrinsic(*INFRARED)
        if motion[0, 3] >= 0.0:
            raise ValueError(
                f'{self.path}: Extrinsic from "Infrared 1" To "Infrared 2": x is {motion[0, 3]:g} m, expected below 0: '
                "left and right are swapped"
            )
        return motion

    def extrinsic(self, first: str, second: str) -> NDArray[np.float64]:
        """Returns the 4x4 first_to_second of two streams. Raises ValueError if neither it nor its inverse is known."""
        if (first, second) in self.extrinsics:
            return self.extrinsics[first, second]
        if (second, first) in self.extrinsics:
            return np.linalg.inv(self.extrinsics[second, first])
        raise ValueError(
            f'{self.path}: Extrinsic from "{first}" To "{second}": is missing: run rs-enumerate-devices -c, with -c'
        )


def read_device_text(path: Path) -> DeviceText:
    """Reads the output of rs-enumerate-devices -c from a file. Raises ValueError with file, key and value."""
    lines = read_text(path, errors="replace").splitlines()
    intrinsics: dict[tuple[str, int, int], Camera] = {}
    extrinsics: dict[tuple[str, str], NDArray[np.float64]] = {}
    for number, line in enumerate(lines):
        if found := _INTRINSIC.search(line):
            key = found["stream"], int(found["width"]), int(found["height"])
            intrinsics.setdefault(key, _intrinsic(path, key, lines[number + 1 : number + 12]))
        elif found := _EXTRINSIC.search(line):
            name = f"{path}: {line.strip()}"
            turn, _, shift = "\n".join(lines[number + 1 : number + 8]).partition("Translation Vector")
            rotation = [float(n) for n in _NUMBER.findall(turn)]
            translation = [float(n) for n in _NUMBER.findall(shift.partition("\n")[0])]
            if len(rotation) < 9 or len(translation) < 3:
                raise ValueError(
                    f"{name} {len(rotation)} numbers of rotation and {len(translation)} of translation, expected 9 and "
                    "3"
                )
            motion = printed_motion(rotation[:9], translation[:3], name)
            extrinsics.setdefault((found["first"], found["second"]), motion)
    if not intrinsics:
        raise ValueError(f'{path}: "Intrinsic of": is nowhere in it: give the output of rs-enumerate-devices -c')
    return DeviceText(path, intrinsics, extrinsics)


def _intrinsic(path: Path, key: tuple[str, int, int], lines: list[str]) -> Camera:
    stream, width, height = key
    name = f'Intrinsic of "{stream}" / {width}x{height}'
    fields: dict[str, str] = {}
    for line in lines:
        if _INTRINSIC.search(line):
            break
        if found := _FIELD.match(line):
            fields.setdefault(found["key"], found["value"].strip())
    numbers = {}
    for field in ("Fx", "Fy", "PPX", "PPY"):
        if field not in fields or not _NUMBER.fullmatch(fields[field]):
            raise ValueError(f"{path}: {name}: {field} is {fields.get(field, 'missing')!r}, expected a number")
        numbers[field] = float(fields[field])
    if numbers["Fx"] <= 0 or numbers["Fy"] <= 0:
        raise ValueError(f"{path}: {name}: Fx, Fy are {numbers['Fx']:g}, {numbers['Fy']:g}, expected above 0")
    model = fields.get("Distortion", "none").lower()
    coefficients = np.array([float(n) for n in _NUMBER.findall(fields.get("Coeffs", ""))] or [0.0] * 5)
    if len(coefficients) != 5:
        raise ValueError(f"{path}: {name}: Coeffs has {len(coefficients)} numbers, expected 5")
    if np.any(coefficients) and model not in _BROWN[:3]:
        raise ValueError(
            f"{path}: {name}: Distortion is {model!r} with coefficients that are not zero: record rectified infrared "
            "(Y8)"
        )
    K = np.array([[numbers["Fx"], 0.0, numbers["PPX"]], [0.0, numbers["Fy"], numbers["PPY"]], [0.0, 0.0, 1.0]])
    return Camera(width, height, K, coefficients)
