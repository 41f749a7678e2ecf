# SPDX-License-Identifier: Apache-2.0
"""A calibration of both infrared cameras, whichever program wrote it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from activestereo.capture.importers.calibration_yaml import read_calibration_yaml
from activestereo.capture.importers.middlebury import is_middlebury, read_middlebury
from activestereo.capture.importers.realsense_text import INFRARED, DeviceText, read_device_text
from activestereo.capture.importers.trajectory import refuse_foreign
from activestereo.common.baseline import with_baseline
from activestereo.common.input_files import read_text

# JSON is YAML, and OpenCV's FileStorage writes both.
_YAML = (".yaml", ".yml", ".json")


def read_calibration_files(
    paths: Sequence[Path], are_rectified: bool, baseline_m: float | None, size: tuple[int, int] | None
) -> DeviceText:
    """The DeviceText of one file, or of ROS' or OpenCV's two.

    are_rectified: the images are those of P. baseline_m: used if the files state none in metres. size: (width, height)
    of the images, for files without it. Raises ValueError with file, key, value and remedy."""
    for path in paths:
        refuse_foreign(path)
    texts = [read_text(path, errors="replace") for path in paths]
    if any(p.suffix.lower() in _YAML or text.startswith("%YAML") for p, text in zip(paths, texts, strict=True)):
        device = read_calibration_yaml(paths, are_rectified, baseline_m, size)
    elif len(paths) > 1:
        raise ValueError(f"{paths[1]}: --calibration is given twice: only ROS' and OpenCV's YAML has two files")
    elif is_middlebury(texts[0]):
        device = read_middlebury(paths[0])
    elif are_rectified:
        raise ValueError(f"{paths[0]}: --rectified is about ROS' and OpenCV's YAML: leave it out")
    else:
        device = read_device_text(paths[0])
    is_told = INFRARED in device.extrinsics or INFRARED[::-1] in device.extrinsics
    if not is_told and baseline_m is None:
        return device  # whoever asks for the extrinsic is told that it is missing
    told = device.extrinsic(*INFRARED) if is_told else np.eye(4)
    motion = with_baseline(str(device.path), told, baseline_m)
    return replace(device, extrinsics=device.extrinsics | {INFRARED: motion})
