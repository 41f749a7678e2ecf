# SPDX-License-Identifier: Apache-2.0
"""Changes a sensor's configuration to a sensor model's rig, pattern, imager and calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.common.lens import is_distorting
from activestereo.common.pose import CAMERA_TO_BODY, Pose, as_matrix
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.model.model import Imager, SensorModel


def configured(given: Mapping[str, Any], model: SensorModel) -> dict[str, Any]:
    """Returns {field: new value} of the configuration fields that the model changes. given: all fields of the present
    configuration. Effects and materials are no fields: StereoDepthSensor(config, scene, model=model) takes them."""
    changes: dict[str, Any] = {}
    if (rig := model.rig) is not None:
        left = as_matrix(given["trans_pose_l"]) @ CAMERA_TO_BODY
        places = {"trans_pose_r": rig.left_to_right, "pose_rgb_irproj": rig.left_to_projector}
        rotation, shift = rig.left_to_right[:3, :3], rig.left_to_right[1:3, 3]
        is_aligned = np.allclose(rotation, np.eye(3), atol=1e-6) and np.allclose(shift, 0.0, atol=1e-6)
        is_ideal = not is_distorting(rig.left.distortion) and not is_distorting(rig.right.distortion)
        changes |= {
            "ir_resolution": rig.left.size,
            "ir_intrinsic": np.array(rig.left.K),
            "ir_distortion": tuple(map(float, rig.left.distortion)),
            "ir_intrinsic_right": np.array(rig.right.K),
            "ir_distortion_right": tuple(map(float, rig.right.distortion)),
            **{n: Pose(left @ np.linalg.inv(to) @ CAMERA_TO_BODY.T) for n, to in places.items() if to is not None},
            "rectified": bool(is_ideal and is_aligned),
            "ir_line_time_s": rig.line_time_s or 0.0,
        }
        if rig.exposure_s is not None:
            # The gain is in `ir_signal`.
            changes |= {"ir_camera_exposure": rig.exposure_s, "ir_camera_gain": 1.0, "ir_exposure_mode": "fixed"}
    if (pattern := model.pattern) is not None:
        changes["pattern_intrinsic"] = np.array(pattern.K)
        if pattern.dots is None:
            changes |= {"light_pattern": str(pattern.file), "light_dots": None}
        else:
            (width, height), sigma_px = pattern.size or (0, 0), float(pattern.dot_sigma_px or 1.0)
            design = replace(given["pattern_design"], width=width, height=height, dot_sigma_px=sigma_px)
            changes |= {"pattern_design": design, "light_dots": np.asarray(pattern.dots, dtype=np.float32)}
            changes["light_dot_background"] = pattern.background
    if model.imager is not None or model.rig is not None:
        changes["ir_signal"] = _signal(model)
    if model.nuisances:
        # The model is fitted to images, so it has no optics, beam or speckle except by effects. The limit of fireflies
        # belongs to the renderer and stays.
        limit = (given["ir_optics"] or {}).get("firefly_factor")
        changes |= {"ir_optics": limit and {"firefly_factor": limit}, "ir_speckle_of_laser": False}
        changes |= {"projector_beam_radius_m": 0.0, "projector_falloff": 0.0, "pixel_blur_px": 0.0}
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


def exposed(given: Mapping[str, Any], model: SensorModel, frame: Frame) -> dict[str, Any]:
    """Returns configured()'s changes, with the exposure and light of `frame`, one of the capture's to which the model
    was fitted. Only products of light and responsivity are known. So the ambient radiance is 1, or less in a dark room,
    and the responsivity is the fitted ambient scale."""
    room, projector = (model.nuisances[name].value for name in ("ambient_scale", "projector_scale"))
    room *= 1.0 if frame.ambient is None else frame.ambient
    responsivity_dn = max(room, 1e-6 * projector)
    rig = model.rig and replace(model.rig, exposure_s=None, gain=None)  # those of the frame
    power_mw = frame.projector_power * given["laser_power_nominal_mw"]
    low, high, step = given["laser_power_limits_mw"]
    return configured({**given, "ir_responsivity_dn": responsivity_dn}, replace(model, rig=rig)) | {
        "ir_responsivity_dn": responsivity_dn,
        "ir_ambient_radiance": room / responsivity_dn,
        "laser_power_mw": power_mw,
        "laser_power_limits_mw": (low, max(high, power_mw), step),  # a capture's power has any unit
        "ir_exposure_mode": "fixed",
        "ir_camera_exposure": frame.exposure_s,
        "ir_camera_gain": frame.gain,
    }


def _signal(model: SensorModel) -> dict[str, float]:
    """Returns simsense's imager parameters for a model's noise, in counts: one electron is one count at gain 1. The
    model's variance terms become read noise, shot noise and speckle."""
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
