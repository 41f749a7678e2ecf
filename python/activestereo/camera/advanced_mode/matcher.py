# SPDX-License-Identifier: Apache-2.0
"""Matches recorded pairs under advanced-mode settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.advanced_mode.settings import AdvancedSettings, DepthTable, depth_table, matcher_parameters
from activestereo.common.pose import rigid_motion

_DISPARITY_STEPS = 32  # of a pixel, the step of disparities in images
_IN_COUNTS_OF_8_BITS = ("p2_full_gradient_dn", "min_texture_dn", "low_texture_dn", "census_noise_dn")


class PairMatcher:
    """Matches rectified pairs of one image size. K: 3x3 of the left and the right image, px; only cx may differ. first:
    an image with the pairs' size and dtype. base: simsense's matcher parameters at the camera's default settings, for
    8-bit images. overrides: parameters of simsense's rig and matcher that replace those from the settings."""

    def __init__(
        self,
        K: tuple[NDArray[np.float64], NDArray[np.float64]],
        baseline_m: float,
        first: NDArray[np.generic],
        settings: AdvancedSettings,
        base: Mapping[str, Any],
        overrides: Mapping[str, Any],
        device: simsense.Device,
    ) -> None:
        height, width = first.shape
        bits = 8 * first.itemsize
        self.table: DepthTable = depth_table(settings)
        matcher = matcher_parameters(settings, base)
        matcher["min_depth_m"], matcher["max_depth_m"] = self.table.min_depth_m, self.table.max_depth_m
        for name in _IN_COUNTS_OF_8_BITS:
            matcher[name] <<= bits - 8
        left, right = (simsense.Camera(width, height, own) for own in K)
        left_to_right = rigid_motion((-baseline_m, 0.0, 0.0))
        self._engine = simsense.Engine(
            device, left, right, left_to_right, rectified=True, bit_depth=bits, **(matcher | overrides)
        )

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters of the engine by name."""
        return dict(self._engine.parameters)

    def image(self, left: NDArray[np.generic], right: NDArray[np.generic]) -> NDArray[np.uint16]:
        """Computes the depth image in the camera's format, 0 = no measurement. Values are depths in units of the depth
        table, or disparities in 1/32 pixel if the table says so."""
        name = "disparity" if self.table.is_disparity else "depth"
        values = np.maximum(np.asarray(self._engine.compute(left, right, (name,))[name], np.float64), 0.0)
        values = values * _DISPARITY_STEPS if self.table.is_disparity else values / self.table.unit_m
        return np.clip(np.rint(values), 0, np.iinfo(np.uint16).max).astype(np.uint16)
