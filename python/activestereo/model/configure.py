# SPDX-License-Identifier: Apache-2.0
"""Makes a sensor's configuration from its model, which replaces the preset's rig, pattern, imager and calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.lens import is_distorting
from activestereo.common.pattern import PatternDesign
from activestereo.common.pose import CAMERA_TO_BODY, Pose, as_matrix
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.model.model import Imager, Pattern, Rig, SensorModel


def configured(given: Mapping[str, Any], model: SensorModel) -> dict[str, Any]:
    """The fields of a configuration that the model changes, with their new values. given: the configuration's present
    fields. Give the model to the sensor for its effects and materials: StereoDepthSensor(config, scene,
    model=model)."""
    changes: dict[str, Any] = {}
    if model.rig is not None:
        changes |= _rig(given["trans_pose_l"], model.rig)
    if model.pattern is not None:
        changes |= _pattern(given["pattern_design"], model.pattern)
    if model.imager is not None or model.rig is not None:
        changes["ir_signal"] = _signal(model)
    if model.nuisances:
        # The model is fitted to images: optics, beam and speckle without an effect are absent. The limit of fireflies
        # is the renderer's, so it stays.
        limit = (given["ir_optics"] or {}).get("firefly_factor")
        changes |= {"ir_optics": limit and {"firefly_factor": limit}, "ir_speckle_of_laser": False}
        changes |= {"projector_beam_radius_m": 0.0, "projector_falloff": 0.0}
        if model.imager is None:
            signal = changes.get("ir_signal", given["ir_signal"]) or {}
            changes["ir_signal"] = {k: v for k, v in signal.items() if not k.startswith("speckle")} or None
    if "black_dn" in model.nuisances:
        changes["ir_black_level_dn"] = model.nuisances["black_dn"].value
    if "projector_scale" in model.nuisances:
        # The fit knows the product of power and responsivity alone; the configuration's responsivity stays.
        changes["projector_intensity"] = model.nuisances["projector_scale"].value / given["ir_responsivity_dn"]
        changes["laser_power_mw"] = given["laser_power_nominal_mw"]
    return changes


def _rig(left_pose: Pose, rig: Rig) -> dict[str, Any]:
    ideal = not is_distorting(rig.left.distortion) and not is_distorting(rig.right.distortion)
    changes: dict[str, Any] = {
        "ir_resolution": (rig.left.width, rig.left.height),
        "ir_intrinsic": np.array(rig.left.K),
        "ir_distortion": tuple(map(float, rig.left.distortion)),
        "ir_intrinsic_right": np.array(rig.right.K),
        "ir_distortion_right": tuple(map(float, rig.right.distortion)),
        "trans_pose_r": _beside(left_pose, rig.left_to_right),
        "rectified": bool(
            ideal
            and np.allclose(rig.left_to_right[:3, :3], np.eye(3), atol=1e-6)
            and np.allclose(rig.left_to_right[1:3, 3], 0.0, atol=1e-6)
        ),
        "ir_line_time_s": rig.line_time_s or 0.0,
    }
    if rig.left_to_projector is not None:
        changes["pose_rgb_irproj"] = _beside(left_pose, rig.left_to_projector)
    if rig.exposure_s is not None:
        # The model's gain is in the signal.
        changes |= {"ir_camera_exposure": rig.exposure_s, "ir_camera_gain": 1.0, "ir_exposure_mode": "fixed"}
    return changes


def _beside(left: Pose, left_to_other: NDArray[np.float64]) -> Pose:
    """Body pose of a part at a fixed place from the left camera. left_to_other: 4x4 in camera axes."""
    return Pose(as_matrix(left) @ CAMERA_TO_BODY @ np.linalg.inv(left_to_other) @ CAMERA_TO_BODY.T)


def _pattern(design: PatternDesign, pattern: Pattern) -> dict[str, Any]:
    changes: dict[str, Any] = {"pattern_intrinsic": np.array(pattern.K)}
    if pattern.dots is None:
        return changes | {"light_pattern": str(pattern.file), "light_dots": None}
    width, height = pattern.size or (0, 0)
    return changes | {
        "pattern_design": replace(design, width=width, height=height, dot_sigma_px=float(pattern.dot_sigma_px or 1.0)),
        "light_dots": np.asarray(pattern.dots, dtype=np.float32),
        "light_dot_background": pattern.background,
    }


def _signal(model: SensorModel) -> dict[str, float]:
    """simsense's imager in counts (an electron is a count at gain 1): the noise model's terms as read noise, shot noise
    and speckle."""
    signal: dict[str, float] = {}
    if model.rig is not None:
        signal["bit_depth"] = model.rig.bit_depth
        signal["gain"] = model.rig.gain or 1.0
    imager: Imager | None = model.imager
    if imager is not None:
        signal["adc_noise_dn"] = float(np.sqrt(max(imager.offset.value - ROUNDING_VARIANCE, 0.0)))
        signal["shot_noise"] = float(np.sqrt(imager.shot.value))
        if imager.relative.value > 0.0:
            signal["speckle_shape"], signal["speckle_scale"] = 1.0 / imager.relative.value, imager.relative.value
    return signal
