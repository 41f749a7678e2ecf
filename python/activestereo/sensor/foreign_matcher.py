# SPDX-License-Identifier: Apache-2.0
"""A matcher that is not simsense's behind a sensor: its disparities become the maps that simsense's would."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.camera.registration import registered


class Matcher(Protocol):
    """Matches rectified pairs, uint8 or uint16 [pairs, height, width]."""

    def __call__(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """(disparities, confidences or None), float32 [pairs, height, width]; pixels of the left image, NaN or not
        above 0 where nothing was measured; confidences 0..1."""


# What a sensor takes: simsense's own matcher, OpenCV's, the path of an ONNX file, or a Matcher.
MatcherLike = str | PathLike[str] | Matcher
_IMAGES = ("ir_left", "ir_right", "rectified_left", "rectified_right")


def as_matcher(given: MatcherLike, config: StereoDepthSensorConfig) -> Matcher | None:
    """The matcher, None for simsense's. ValueError says what else it may be."""
    if callable(given):
        return given
    if given == "simsense":
        return None
    if given == "opencv":
        from activestereo.sensor.opencv_matcher import OpenCVMatcher

        return OpenCVMatcher(config)
    if str(given).endswith(".onnx"):
        from activestereo.sensor.onnx_matcher import OnnxMatcher

        return OnnxMatcher(given)
    raise ValueError(f"matcher is {given!r}, expected 'simsense', 'opencv', the path of an .onnx file, or a Matcher")


def foreign_maps(
    matcher: Matcher, engine: simsense.Engine, config: StereoDepthSensorConfig, pair: tuple[Any, Any], outputs: Any,
    lasers: dict[str, Any],
) -> dict[str, NDArray[Any]]:  # fmt: skip
    """simsense.Engine.compute() with this matcher in place of its own: imager and rectification are the engine's.
    outputs: names, or the arrays by name that they are written into. ValueError where the matcher gives other sizes."""
    images = dict(engine.compute(*pair, _IMAGES, **lasers))
    left, right = images["rectified_left"], images["rectified_right"]
    leading = left.shape[:-2]
    disparity, confidence = matcher(*(image.reshape(-1, *image.shape[-2:]) for image in (left, right)))
    expected = (int(np.prod(leading)), *left.shape[-2:])
    for name, found in (("disparities", disparity), ("confidences", confidence)):
        if found is not None and found.shape != expected:
            raise ValueError(f"the matcher gives {name} of {list(found.shape)}, expected {list(expected)}")
    maps = images | {
        name: values.reshape(*leading, *values.shape[1:])
        for name, values in _maps(engine, config, np.asarray(disparity, np.float32), confidence).items()
    }
    missing = [name for name in outputs if name not in maps]
    if missing:
        raise ValueError(f"only simsense's own matcher gives {', '.join(missing)}")
    if isinstance(outputs, Mapping):
        for name, target in outputs.items():
            np.copyto(target, maps[name].reshape(target.shape))
    return {name: maps[name] for name in outputs}


def _maps(
    engine: simsense.Engine,
    config: StereoDepthSensorConfig,
    disparity: NDArray[np.float32],
    confidence: NDArray[np.float32] | None,
) -> dict[str, NDArray[Any]]:
    k, baseline_m, left_to_rectified = engine.rectified
    is_measured = np.isfinite(disparity) & (disparity > 0)
    z = np.where(is_measured, k[0, 0] * baseline_m / np.where(is_measured, disparity, 1.0), 0.0)
    depth = np.where((z >= config.min_depth_m) & (z < config.max_depth_m), z, 0.0).astype(np.float32)
    v, u = np.indices(depth.shape[-2:])
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones(u.shape)], axis=-1)
    reason = np.where(is_measured, simsense.REASONS.index("valid"), simsense.REASONS.index("not_unique"))
    reason = np.where(is_measured & (depth == 0), simsense.REASONS.index("out_of_range"), reason)
    return {
        "disparity": np.where(is_measured, disparity, -1.0).astype(np.float32),
        "confidence": np.where(is_measured, 1.0 if confidence is None else confidence, 0.0).astype(np.float32),
        "reason": reason.astype(np.uint8),
        "depth": depth,
        "points": (rays * depth[..., None]).astype(np.float32),
        "depth_rgb": np.stack([registered(one, k, left_to_rectified, config) for one in depth]),
    }
