# SPDX-License-Identifier: Apache-2.0
"""Reads a calibration of both infrared cameras, whichever program wrote it, and Middlebury's calib.txt.

The Middlebury stereo sets of 2014 and later and ETH3D's two-view sets have a calib.txt: cam0 and cam1 as [f 0 cx; 0 f
cy; 0 0 1], doffs = cx1 - cx0 in pixels, baseline in millimetres, width and height.

    z = f x baseline / (disparity + doffs)     (https://vision.middlebury.edu/stereo/data/scenes2014/)
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from activestereo.capture.capture import Camera
from activestereo.capture.importers.calibration_yaml import read_calibration_yaml
from activestereo.capture.importers.color_depth import camera_matrix_of
from activestereo.capture.importers.realsense_text import INFRARED, DeviceText, read_device_text
from activestereo.capture.importers.trajectory import refuse_foreign
from activestereo.common.baseline import with_baseline
from activestereo.common.input_files import read_text
from activestereo.common.limits import LENGTH, SIDE
from activestereo.common.shown import shown

_LINE = re.compile(r"^\s*(\w+)\s*=\s*(.*?)\s*$", re.M)
_MOST_ROUNDING_PX = 0.01


def read_middlebury(path: Path) -> DeviceText:
    """Reads both rectified cameras from a calib.txt. Raises ValueError with file, key and value."""
    values, K = dict(_LINE.findall(read_text(path))), []

    def numbers(key: str, is_matrix: bool = False) -> list[float]:
        if not values.get(key):
            raise ValueError(f"{path}: {key}: is missing")
        out = []
        for word in values[key].strip("[]").replace(";", " ").split() if is_matrix else [values[key]]:
            try:
                number = float(word)
            except ValueError:
                raise ValueError(f"{path}: {key}: is {shown(word)}, expected a number") from None
            out.append(float(LENGTH.check(f"{path}: {key}:", number)))
        return out

    for key in ("cam0", "cam1"):
        K.append(camera_matrix_of(path, key, numbers(key, is_matrix=True)))
    (doffs,) = numbers("doffs") if "doffs" in values else [float(K[1][0, 2] - K[0][0, 2])]
    if abs(K[1][0, 2] - K[0][0, 2] - doffs) > _MOST_ROUNDING_PX:
        raise ValueError(f"{path}: doffs: is {doffs:g}, expected cx1 - cx0, which is {K[1][0, 2] - K[0][0, 2]:g} px")
    (width,), (height,), (baseline_mm,) = numbers("width"), numbers("height"), numbers("baseline")
    for key, side in (("width", width), ("height", height)):
        SIDE.check(f"{path}: {key}:", int(side) if side.is_integer() else side)
    return DeviceText.of_pair(path, [Camera(int(width), int(height), own) for own in K], 1e-3 * baseline_mm)


# JSON is YAML, and OpenCV's FileStorage writes both.
_YAML = (".yaml", ".yml", ".json")


def read_calibration_files(
    paths: Sequence[Path], are_rectified: bool, baseline_m: float | None, size: tuple[int, int] | None
) -> DeviceText:
    """Reads the calibration from one file, or from the two that ROS or OpenCV write. are_rectified: the images are
    rectified ones, described by P. baseline_m: the user's baseline, or None. size: (width, height) of the images, for
    files without it. Raises ValueError with file, key, value and remedy."""
    for path in paths:
        refuse_foreign(path)
    texts = [read_text(path, errors="replace") for path in paths]
    if any(p.suffix.lower() in _YAML or text.startswith("%YAML") for p, text in zip(paths, texts, strict=True)):
        device = read_calibration_yaml(paths, are_rectified, baseline_m, size)
    elif len(paths) > 1:
        raise ValueError(f"{paths[1]}: --calibration is given twice: only ROS' and OpenCV's YAML has two files")
    elif re.search(r"^\s*cam0\s*=", texts[0], re.M):
        device = read_middlebury(paths[0])
    elif are_rectified:
        raise ValueError(f"{paths[0]}: --rectified is about ROS' and OpenCV's YAML: leave it out")
    else:
        device = read_device_text(paths[0])
    is_told = INFRARED in device.extrinsics or INFRARED[::-1] in device.extrinsics
    if not is_told and baseline_m is None:
        return device  # extrinsic() raises later if it is asked for
    told = device.extrinsic(*INFRARED) if is_told else np.eye(4)
    motion = with_baseline(str(device.path), told, baseline_m)
    return replace(device, extrinsics=device.extrinsics | {INFRARED: motion})
