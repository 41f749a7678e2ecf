# SPDX-License-Identifier: Apache-2.0
"""Matches rectified infrared pairs with the depth engine under advanced-mode settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.advanced_mode.settings import AdvancedSettings, DepthTable, depth_table, matcher_parameters

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
        self._bits = 8 * first.itemsize
        self._base, self._overrides = dict(base), dict(overrides)
        self.table: DepthTable = depth_table(settings)
        left, right = (simsense.Camera(width, height, own) for own in K)
        left_to_right = np.eye(4)
        left_to_right[0, 3] = -baseline_m
        self._engine = simsense.Engine(
            device, left, right, left_to_right, rectified=True, bit_depth=self._bits, **self._parameters(settings)
        )

    def _parameters(self, settings: AdvancedSettings) -> dict[str, Any]:
        out = matcher_parameters(settings, self._base)
        out["min_depth_m"], out["max_depth_m"] = self.table.min_depth_m, self.table.max_depth_m
        for name in _IN_COUNTS_OF_8_BITS:
            out[name] <<= self._bits - 8
        return out | self._overrides

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters of the engine by name."""
        return dict(self._engine.parameters)

    def set_settings(self, settings: AdvancedSettings) -> None:
        """Sets the matcher's parameters for the next pairs from these settings; the depth table stays."""
        matcher = self._parameters(settings)
        self._engine.set_parameters(**{name: matcher[name] for name in self._engine.parameters if name in matcher})

    def disparity(self, left: NDArray[np.generic], right: NDArray[np.generic]) -> NDArray[np.float32]:
        """Computes the left image's disparity in pixels, float32 [height, width], -1 = not measured."""
        return np.array(self._engine.compute(left, right, ("disparity",))["disparity"], np.float32)

    def image(self, left: NDArray[np.generic], right: NDArray[np.generic]) -> NDArray[np.uint16]:
        """Computes the depth image in the camera's format, 0 = no measurement. Values are depths in units of the depth
        table, or disparities in 1/32 pixel if the table says so."""
        if self.table.is_disparity:
            values = _DISPARITY_STEPS * np.maximum(self.disparity(left, right), 0.0).astype(np.float64)
        else:
            depth = self._engine.compute(left, right, ("depth",))["depth"]
            values = np.asarray(depth, np.float64) / self.table.unit_m
        return np.clip(np.rint(values), 0, np.iinfo(np.uint16).max).astype(np.uint16)
