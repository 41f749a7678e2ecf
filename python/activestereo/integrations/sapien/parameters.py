# SPDX-License-Identifier: Apache-2.0
"""The methods of SAPIEN's StereoDepthSensor that change its parameters."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import activestereo
from activestereo.integrations.sapien.config import check_config, own_value


class Parameters:
    """A configuration, and the sensor that follows it once it is there. Raises TypeError for values that SAPIEN
    refuses."""

    _config: Any
    _sensor: activestereo.StereoDepthSensor | None

    def set_ir_noise(self, ir_speckle_noise: float, ir_thermal_noise: float) -> None:
        self._set("set_ir_noise", ir_speckle_noise=ir_speckle_noise, ir_thermal_noise=ir_thermal_noise)

    def set_census_window_size(self, census_width: int, census_height: int) -> None:
        self._set("set_census_window_size", census_width=census_width, census_height=census_height)

    def set_matching_block_size(self, block_width: int, block_height: int) -> None:
        self._set("set_matching_block_size", block_width=block_width, block_height=block_height)

    def set_penalties(self, p1_penalty: int, p2_penalty: int) -> None:
        self._set("set_penalties", p1_penalty=p1_penalty, p2_penalty=p2_penalty)

    def set_uniqueness_ratio(self, uniqueness_ratio: int) -> None:
        self._set("set_uniqueness_ratio", uniqueness_ratio=uniqueness_ratio)

    def set_lr_max_diff(self, lr_max_diff: int) -> None:
        self._set("set_lr_max_diff", lr_max_diff=lr_max_diff)

    def _set(self, setter: str, **changes: Any) -> None:
        """setter: our sensor's method that takes these."""
        changed = deepcopy(self._config)
        for name, value in changes.items():
            setattr(changed, name, value)
        check_config(changed)
        if self._sensor is not None:
            getattr(self._sensor, setter)(*(own_value(name, value) for name, value in changes.items()))
        for name, value in changes.items():
            setattr(self._config, name, value)
