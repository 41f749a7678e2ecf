# SPDX-License-Identifier: Apache-2.0
"""Converts SAPIEN's configuration of a depth sensor to ours, and sets its parameters. Refuses the same values as
SAPIEN."""

from __future__ import annotations

from copy import deepcopy
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import activestereo
from activestereo.camera.presets import SAPIEN_NAMES
from activestereo.camera.presets import StereoDepthSensorConfig as NativeConfig
from activestereo.common.input_files import checked_file
from activestereo.common.pose import Pose, as_matrix

_NATIVE_NAMES = {given: own for own, given in SAPIEN_NAMES.items()}


class Parameters:
    """Holds a configuration, and passes changes on to the sensor once it exists. Raises TypeError for values that
    SAPIEN refuses."""

    _config: Any
    _sensor: activestereo.StereoDepthSensor | None

    def set_ir_noise(self, ir_speckle_noise: float, ir_thermal_noise: float) -> None:
        """Sets factors on the default noise; ir_speckle_noise 0 switches both kinds off."""
        self.change(ir_speckle_noise=ir_speckle_noise, ir_thermal_noise=ir_thermal_noise)

    def set_census_window_size(self, census_width: int, census_height: int) -> None:
        """Sets the census window's sides, odd numbers of pixels."""
        self.change(census_width=census_width, census_height=census_height)

    def set_matching_block_size(self, block_width: int, block_height: int) -> None:
        """Sets the sides of the block that matching costs are summed over, odd numbers of pixels."""
        self.change(block_width=block_width, block_height=block_height)

    def set_penalties(self, p1_penalty: int, p2_penalty: int) -> None:
        """Sets the costs of a disparity step between neighbours: p1_penalty of one pixel, p2_penalty of more."""
        self.change(p1_penalty=p1_penalty, p2_penalty=p2_penalty)

    def set_uniqueness_ratio(self, uniqueness_ratio: int) -> None:
        """Sets by how many percent the best disparity must beat the others."""
        self.change(uniqueness_ratio=uniqueness_ratio)

    def set_lr_max_diff(self, lr_max_diff: int) -> None:
        """Sets the largest difference of the left and right disparities, in pixels; 255 switches the check off."""
        self.change(lr_max_diff=lr_max_diff)

    def change(self, **changes: Any) -> None:
        """Changes fields, by SAPIEN's names, of the configuration and of the sensor."""
        changed = deepcopy(self._config)
        for name, value in changes.items():
            setattr(changed, name, value)
        check_config(changed)
        if self._sensor is not None:
            native = {_NATIVE_NAMES.get(name, name): own_value(name, value) for name, value in changes.items()}
            self._sensor.change(**native)
        for name, value in changes.items():
            setattr(self._config, name, value)


class StereoDepthSensorConfig(NativeConfig):
    """SAPIEN's configuration for its two models, with SAPIEN's default values and all other fields of ours. The sensor
    also takes activestereo's own StereoDepthSensorConfig("D435"), which has the real device's errors."""

    SUPPORTED_MODELS = ("D415", "D435")

    def __init__(self, model: str = "D435") -> None:
        name = model.removeprefix("sapien-")  # the presets' names
        if name not in self.SUPPORTED_MODELS:
            raise ValueError(f"Invalid sensor model '{model}', must be one of: {self.SUPPORTED_MODELS}")
        super().__init__(f"sapien-{name}")


def native_config(config: Any) -> NativeConfig:
    """Converts a configuration in SAPIEN's conventions to ours: pixel centres at integers, our Pose."""
    out = NativeConfig("sapien-D435")
    for name in NativeConfig._FIELDS:
        given = name if hasattr(config, name) else SAPIEN_NAMES.get(name, name)
        if hasattr(config, given):
            value = getattr(config, given)
            is_pose = hasattr(value, "to_transformation_matrix")
            setattr(out, name, Pose(as_matrix(value)) if is_pose else deepcopy(own_value(name, value)))
    for name in ("rgb_intrinsic", "ir_intrinsic", "ir_intrinsic_right"):
        if getattr(out, name) is not None:
            k = np.array(getattr(out, name), np.float64)
            k[:2, 2] -= 0.5
            setattr(out, name, k)
    if isinstance(out.light_pattern, (str, PathLike)) and out.light_pattern != "generated":
        with Image.open(checked_file(Path(out.light_pattern))) as image:  # SAPIEN's projector is red
            out.light_pattern = np.ascontiguousarray(np.asarray(image.convert("RGB"))[..., 0])
    return out


def own_value(name: str, value: Any) -> Any:
    """Converts the value of field `name` from SAPIEN's convention to ours. SAPIEN switches the left-right check off by
    255 pixels, we by -1. Its uniqueness ratio may exceed 100 %, ours not."""
    if name == "lr_max_diff":
        return -1 if value == 255 else value
    return min(value, 100) if name == "uniqueness_ratio" else value


def check_config(c: Any) -> None:
    """Raises TypeError for each value that SAPIEN's SimSenseComponent refuses. c: a configuration with SAPIEN's field
    names."""
    noise = ("ir_speckle_noise", "ir_thermal_noise")
    census, block = ("census_width", "census_height"), ("block_width", "block_height")
    is_quiet = c.ir_speckle_noise == 0
    is_rising = _is_int(c.p1_penalty, 1) and _is_int(c.p2_penalty, 1, 223) and c.p1_penalty < c.p2_penalty
    rules = [
        (("ir_resolution",), all(_is_int(v, 32) for v in c.ir_resolution), "two whole numbers of at least 32"),
        (noise, is_quiet or (c.ir_speckle_noise > 0 and c.ir_thermal_noise > 0), "both above 0, or the first one 0"),
        (census, _is_window(c.census_width, c.census_height, 65), "odd, above 0, their product at most 65"),
        (("max_disp",), _is_int(c.max_disp, 32, 1024), "a whole number from 32 to 1024"),
        (block, _is_window(c.block_width, c.block_height, 256), "odd, above 0, their product at most 256"),
        (("p1_penalty", "p2_penalty"), is_rising, "whole numbers, rising, from 1 to 223"),
        (("uniqueness_ratio",), _is_int(c.uniqueness_ratio, 0, 255), "a whole number from 0 to 255"),
        (("lr_max_diff",), _is_int(c.lr_max_diff, -1, 255), "a whole number from 0 to 255, which switches it off"),
        (("median_filter_size",), c.median_filter_size in (1, 3, 5, 7), "1, 3, 5 or 7"),
    ]
    for names, holds, text in rules:
        if not holds:
            given = ", ".join(str(getattr(c, name)) for name in names)
            raise TypeError(f"{' and '.join(names)} must be {text}; given {given}")


def _is_int(value: Any, low: int, high: int = 2**31) -> bool:
    return isinstance(value, int) and low <= value <= high


def _is_window(width: Any, height: Any, most: int) -> bool:
    return all(_is_int(v, 1) and v % 2 == 1 for v in (width, height)) and width * height <= most
