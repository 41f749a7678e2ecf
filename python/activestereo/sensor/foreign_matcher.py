# SPDX-License-Identifier: Apache-2.0
"""Lets a sensor use another matcher than simsense's, such as a network. The same maps as simsense's are computed from
the matcher's disparities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.plan import SensorPlan, registered
from activestereo.common.lens import to_tangents


class Matcher(Protocol):
    """A callable that matches rectified pairs of images, uint8 or uint16 [pairs, height, width]."""

    def __call__(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Returns (disparities, confidences or None), float32 [pairs, height, width]. Disparities are pixels of the
        left image; NaN, 0 or less = not measured. Confidences are 0..1."""


# Matchers that a sensor accepts: simsense's own, OpenCV's, or a Matcher.
MatcherLike = str | Matcher
_SGBM_BLOCK = 7
_SGBM_STEPS = 16  # OpenCV's disparities are whole numbers of 1/16 pixel
_SGBM_STEP_PX = 16  # its range of disparities is a multiple of this
_IMAGES = ("ir_left", "ir_right", "rectified_left", "rectified_right")


def as_matcher(given: MatcherLike, engine: simsense.Engine) -> Matcher | None:
    """Returns the Matcher that `given` names, or None for simsense's own. engine: its parameters set up OpenCV's
    matcher. Raises ValueError, which lists the choices."""
    if callable(given):
        return given
    if given == "simsense":
        return None
    if given == "opencv":
        return _opencv_matcher(engine.parameters)
    raise ValueError(f"matcher is {given!r}, expected 'simsense', 'opencv', or a function of rectified pairs")


def foreign_maps(
    matcher: Matcher, engine: simsense.Engine, plan: SensorPlan, pair: tuple[Any, Any], outputs: Any,
    lasers: dict[str, Any],
) -> dict[str, NDArray[Any]]:  # fmt: skip
    """Computes maps as simsense.Engine.compute() does, but with this matcher's disparities. The engine still simulates
    the imagers and rectifies the images. pair, lasers: compute()'s arguments. outputs: names, or {name: array to write
    into}. Raises ValueError for arrays of another size, and for outputs that only simsense gives."""
    images = dict(engine.compute(*pair, _IMAGES, **lasers))
    left, right = images["rectified_left"], images["rectified_right"]
    leading = left.shape[:-2]
    disparity, confidence = matcher(*(image.reshape(-1, *image.shape[-2:]) for image in (left, right)))
    expected = (int(np.prod(leading)), *left.shape[-2:])
    for name, found in (("disparities", disparity), ("confidences", confidence)):
        if found is not None and found.shape != expected:
            raise ValueError(f"the matcher gives {name} of {list(found.shape)}, expected {list(expected)}")
    disparity = np.asarray(disparity, np.float32)
    k, baseline_m, left_to_rectified = engine.rectified
    is_measured = np.isfinite(disparity) & (disparity > 0)
    z = np.divide(k[0, 0] * baseline_m, disparity, out=np.zeros_like(disparity), where=is_measured)
    is_near = (z >= plan.engine["min_depth_m"]) & (z < plan.engine["max_depth_m"])
    depth = np.where(is_near, z, 0.0).astype(np.float32)
    depth_rgb = np.stack([registered(one, k, left_to_rectified, plan) for one in depth])
    v, u = np.indices(depth_rgb.shape[-2:])
    rays = np.stack([*to_tangents(u, v, plan.rgb["k"], plan.rgb["distortion"]), np.ones(u.shape)], axis=-1)
    reason = np.where(is_measured, simsense.REASONS.index("valid"), simsense.REASONS.index("not_unique"))
    reason = np.where(is_measured & (depth == 0), simsense.REASONS.index("out_of_range"), reason)
    found_maps = {
        "disparity": np.where(is_measured, disparity, -1.0).astype(np.float32),
        "confidence": np.where(is_measured, 1.0 if confidence is None else confidence, 0.0).astype(np.float32),
        "reason": reason.astype(np.uint8),
        "depth": depth,
        "points": (rays * depth_rgb[..., None]).astype(np.float32),
        "depth_rgb": depth_rgb,
    }
    maps = images | {name: values.reshape(*leading, *values.shape[1:]) for name, values in found_maps.items()}
    missing = [name for name in outputs if name not in maps]
    if missing:
        raise ValueError(f"only simsense's own matcher gives {', '.join(missing)}")
    if isinstance(outputs, Mapping):
        for name, target in outputs.items():
            np.copyto(target, maps[name].reshape(target.shape))
    return {name: maps[name] for name in outputs}


def _opencv_matcher(parameters: Mapping[str, Any]) -> Matcher:
    """Returns a Matcher by OpenCV's semi-global matcher (SGBM) over eight paths. Disparity range, uniqueness and
    left-right check are simsense's parameters, others OpenCV's suggestions. Raises ImportError if cv2 is missing."""
    import cv2

    least = parameters["min_disparity"]
    count = -(-parameters["max_disparity"] // _SGBM_STEP_PX) * _SGBM_STEP_PX
    margin = count + max(0, least)  # OpenCV leaves the first columns out, as many as there are disparities
    sgbm = cv2.StereoSGBM_create(
        minDisparity=least, numDisparities=count, blockSize=_SGBM_BLOCK, P1=8 * _SGBM_BLOCK**2,
        P2=32 * _SGBM_BLOCK**2, disp12MaxDiff=parameters["lr_max_diff"], preFilterCap=63,
        uniquenessRatio=parameters["uniqueness_ratio"], mode=cv2.STEREO_SGBM_MODE_HH4,
    )  # fmt: skip

    def match(left: NDArray[Any], right: NDArray[Any]) -> tuple[NDArray[np.float32], None]:
        found = []
        for pair in zip(left, right, strict=True):
            scale = 255.0 / max(255, *(int(image.max()) for image in pair))
            counts = ((image * scale).astype(np.uint8) for image in pair)
            wide = (cv2.copyMakeBorder(image, 0, 0, margin, 0, cv2.BORDER_REPLICATE) for image in counts)
            disparity = sgbm.compute(*wide)[:, margin:].astype(np.float32) / _SGBM_STEPS
            found.append(np.where(disparity >= least, disparity, np.float32(np.nan)))
        return np.stack(found), None

    return match
