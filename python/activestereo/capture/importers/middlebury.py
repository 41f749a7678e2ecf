# SPDX-License-Identifier: Apache-2.0
"""calib.txt of the Middlebury stereo sets of 2014 and later, which ETH3D's two-view sets have, too: cam0 and cam1 as
[f 0 cx; 0 f cy; 0 0 1], doffs = cx1 - cx0 in pixels, baseline in millimetres, width and height.

    z = f x baseline / (disparity + doffs)     (https://vision.middlebury.edu/stereo/data/scenes2014/)
"""

from __future__ import annotations

import re
from pathlib import Path

from activestereo.capture.capture import Camera
from activestereo.capture.importers.color_depth import camera_matrix_of
from activestereo.capture.importers.realsense_text import DeviceText
from activestereo.common.input_files import read_text
from activestereo.common.limits import LENGTH, SIDE
from activestereo.common.shown import shown

_LINE = re.compile(r"^\s*(\w+)\s*=\s*(.*?)\s*$", re.M)
_MOST_ROUNDING_PX = 0.01


def is_middlebury(text: str) -> bool:
    return re.search(r"^\s*cam0\s*=", text, re.M) is not None


def read_middlebury(path: Path) -> DeviceText:
    """The DeviceText of both rectified cameras. Raises ValueError with file, key and value."""
    values = dict(_LINE.findall(read_text(path)))
    K = []
    for key in ("cam0", "cam1"):
        words = _value(path, values, key).strip("[]").replace(";", " ").split()
        K.append(camera_matrix_of(path, key, [_number(path, key, word) for word in words]))
    doffs = _number(path, "doffs", values.get("doffs", f"{K[1][0, 2] - K[0][0, 2]}"))
    if abs(K[1][0, 2] - K[0][0, 2] - doffs) > _MOST_ROUNDING_PX:
        raise ValueError(f"{path}: doffs: is {doffs:g}, expected cx1 - cx0, which is {K[1][0, 2] - K[0][0, 2]:g} px")
    width, height = (_number(path, key, _value(path, values, key)) for key in ("width", "height"))
    for key, side in (("width", width), ("height", height)):
        SIDE.check(f"{path}: {key}:", int(side) if side.is_integer() else side)
    baseline_m = 1e-3 * _number(path, "baseline", _value(path, values, "baseline"))
    return DeviceText.of_pair(path, [Camera(int(width), int(height), own) for own in K], baseline_m)


def _value(path: Path, values: dict[str, str], key: str) -> str:
    if not values.get(key):
        raise ValueError(f"{path}: {key}: is missing")
    return values[key]


def _number(path: Path, key: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f"{path}: {key}: is {shown(text)}, expected a number") from None
    return float(LENGTH.check(f"{path}: {key}:", number))
