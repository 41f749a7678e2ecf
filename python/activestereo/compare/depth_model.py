# SPDX-License-Identifier: Apache-2.0
"""Computes the model's depth: matches the predicted pair, with the capture's noise, by simsense, as the device
would."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from activestereo.capture.capture import Capture, CaptureWarning, Rig
from activestereo.capture.capture_json import CaptureError
from activestereo.common.lens import lens_fields
from activestereo.common.parameter import MATCHER
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import NoiseModel

# Farther than the engine's own default, because a device's 16 bits of depth reach this far.
_DEFAULT_MAX_DEPTH_M = 65.0
_MAX_DISPARITY = next(p for p in MATCHER if p.name == "max_disparity")
_HINTS = (
    "max_disparity", "census_width", "census_height", "block_width", "block_height", "p1", "p2", "uniqueness_ratio",
    "lr_max_diff", "median_size", "path_count", "min_disparity", "min_depth_m", "max_depth_m",
)  # fmt: skip


def expose(
    expected_dn: np.ndarray, gain: float, noise_model: NoiseModel, max_dn: float, rng: np.random.Generator
) -> np.ndarray:
    """Draws one noisy exposure of an expected image, whole DN in float32. The noise model's quadratic term becomes
    gamma speckle, the other terms normal noise."""
    signal = np.maximum(expected_dn - noise_model.black_dn, 0.0)
    variance = np.maximum(noise_model.offset - ROUNDING_VARIANCE + noise_model.shot * gain * signal, 0.0)
    noise = np.sqrt(variance) * rng.standard_normal(signal.shape)
    if noise_model.relative > 0:
        noise += signal * (rng.gamma(1.0 / noise_model.relative, noise_model.relative, signal.shape) - 1.0)
    return np.clip(np.rint(expected_dn + noise), 0, max_dn).astype(np.float32)


class DepthModel:
    """Matches pairs by simsense with a capture's nominal calibration. Depth is z in the left camera's frame, metres, 0
    = none.

    The capture's depth_engine hints set the engine's parameters of the same names. The rest of the device's matcher is
    unknown, so the other parameters keep the engine's defaults.
    """

    def __init__(self, capture: Capture) -> None:
        import simsense

        rig = capture.rig
        left, right = (
            simsense.Camera(c.width, c.height, c.K, **lens_fields(c.distortion)) for c in (rig.left, rig.right)
        )
        is_ideal = _is_rectified(rig)
        registered: dict[str, Any] = {} if is_ideal else {"rgb": left, "left_to_rgb": np.eye(4)}

        def engine(parameters: Mapping[str, Any]) -> simsense.Engine:
            device, bits = simsense.Device("host"), max(8, rig.bit_depth)
            return simsense.Engine(
                device, left, right, rig.left_to_right, rectified=is_ideal, bit_depth=bits, **registered, **parameters
            )

        self.parameters = _followed(capture.depth_engine)
        try:
            self._engine = engine(self.parameters)
        except simsense.ArgumentError as error:
            text = f"{capture.path}: depth_engine hints cannot be followed: {error}"
            warnings.warn(text, CaptureWarning, stacklevel=2)
            self.parameters = _followed({})
            try:
                self._engine = engine(self.parameters)
            except simsense.ArgumentError as again:
                raise CaptureError(f"{capture.path / 'capture.json'}: rig: depth cannot be judged: {again}") from again
        self._output = "depth" if is_ideal else "depth_rgb"
        self._dtype = np.uint8 if rig.bit_depth <= 8 else np.uint16

    def depth(self, left_dn: np.ndarray, right_dn: np.ndarray) -> np.ndarray:
        """Returns the depth of a pair in whole DN, float32 [height][width] metres."""
        left, right = left_dn.astype(self._dtype), right_dn.astype(self._dtype)
        return self._engine.compute(left, right, outputs=(self._output,))[self._output].copy()


def _followed(hints: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the engine's parameters, set by the hints that it understands."""
    known = {name: hints[name] for name in _HINTS if isinstance(hints.get(name), int | float)}
    parameters = {"max_disparity": _MAX_DISPARITY.default, "max_depth_m": _DEFAULT_MAX_DEPTH_M} | known
    if _MAX_DISPARITY.range is not None:
        least, most = _MAX_DISPARITY.range
        parameters["max_disparity"] = min(max(parameters["max_disparity"], least), most)
    return parameters


def _is_rectified(rig: Rig) -> bool:
    same_k = np.allclose(rig.left.K, rig.right.K) and (rig.left.width, rig.left.height) == (
        rig.right.width,
        rig.right.height,
    )
    shift = rig.left_to_right.copy()
    shift[0, 3] = 0.0
    return same_k and rig.left.is_pinhole and rig.right.is_pinhole and np.allclose(shift, np.eye(4))
