# SPDX-License-Identifier: Apache-2.0
"""A sensor's configuration from its model: what the model says of rig, pattern, imager and calibration in place of a
preset's."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from activestereo.pose import CAMERA_TO_BODY, Pose, as_matrix
from activestereo.sensor_model.model import Imager, Pattern, Rig, SensorModel

if TYPE_CHECKING:
    from activestereo.presets import StereoDepthSensorConfig

# Rounding adds it by itself; it is in a measured variance.
_QUANTISATION_VARIANCE = 1.0 / 12.0


def configure(config: StereoDepthSensorConfig, model: SensorModel) -> None:
    """Changes the configuration. Effects and materials are the sensor's own to apply: StereoDepthSensor(config, scene,
    model=model)."""
    if model.rig is not None:
        _rig(config, model.rig)
    if model.pattern is not None:
        _pattern(config, model.pattern)
    if model.imager is not None or model.rig is not None:
        config.ir_signal = _signal(model)
    if model.nuisances:
        # Fitted to images: what its effects do not say of optics, beam and speckle is not there. Fireflies are the
        # renderer's, not the camera's: their limit stays.
        limit = (config.ir_film or {}).get("firefly_factor")
        config.ir_film, config.ir_speckle_of_laser = limit and {"firefly_factor": limit}, False
        config.projector_beam_radius_m = config.projector_falloff = 0.0
        if model.imager is None:
            config.ir_signal = {
                k: v for k, v in (config.ir_signal or {}).items() if not k.startswith("speckle")
            } or None
    if "black_dn" in model.nuisances:
        config.ir_black_level_dn = model.nuisances["black_dn"].value
    if "projector_scale" in model.nuisances:
        # The fit knows the product of power and responsivity alone; the configuration's responsivity stays.
        config.projector_intensity = model.nuisances["projector_scale"].value / config.ir_responsivity_dn
        config.laser_power_mw = config.laser_power_nominal_mw


def _rig(config: StereoDepthSensorConfig, rig: Rig) -> None:
    config.ir_resolution = (rig.left.width, rig.left.height)
    config.ir_intrinsic, config.ir_distortion = np.array(rig.left.K), tuple(rig.left.distortion)
    config.ir_intrinsic_right, config.ir_distortion_right = np.array(rig.right.K), tuple(rig.right.distortion)
    config.trans_pose_r = _beside(config.trans_pose_l, rig.left_to_right)
    if rig.left_to_projector is not None:
        config.pose_rgb_irproj = _beside(config.trans_pose_l, rig.left_to_projector)
    ideal = not any(rig.left.distortion) and not any(rig.right.distortion)
    config.rectified = bool(
        ideal
        and np.allclose(rig.left_to_right[:3, :3], np.eye(3), atol=1e-6)
        and np.allclose(rig.left_to_right[1:3, 3], 0.0, atol=1e-6)
    )
    config.ir_line_time_s = rig.line_time_s or 0.0
    if rig.exposure_s is not None:
        config.ir_camera_exposure, config.ir_camera_gain = rig.exposure_s, 1.0  # the gain is in the signal
        config.ir_exposure_mode = "fixed"


def _beside(left: Pose, left_to_other: NDArray[np.float64]) -> Pose:
    """Body pose of what stands beside the left camera. left_to_other: 4x4 in camera axes."""
    return Pose(as_matrix(left) @ CAMERA_TO_BODY @ np.linalg.inv(left_to_other) @ CAMERA_TO_BODY.T)


def _pattern(config: StereoDepthSensorConfig, pattern: Pattern) -> None:
    config.pattern_intrinsic = np.array(pattern.K)
    if pattern.dots is None:
        config.light_pattern, config.light_dots = str(pattern.file), None
    else:
        width, height = pattern.size or (0, 0)
        config.pattern_design = replace(
            config.pattern_design, width=width, height=height, dot_sigma_px=float(pattern.dot_sigma_px or 1.0)
        )
        config.light_dots = np.asarray(pattern.dots, dtype=np.float32)
        config.light_dot_background = pattern.background


def _signal(model: SensorModel) -> dict[str, float]:
    """simsense's imager in counts (an electron is a count at gain 1): the noise law's terms as read noise, shot noise
    and speckle."""
    signal: dict[str, float] = {}
    if model.rig is not None:
        signal["bit_depth"] = model.rig.bit_depth
        signal["gain"] = model.rig.gain or 1.0
    law: Imager | None = model.imager
    if law is not None:
        signal["adc_noise_dn"] = float(np.sqrt(max(law.offset.value - _QUANTISATION_VARIANCE, 0.0)))
        signal["shot_noise"] = float(np.sqrt(law.shot.value))
        if law.relative.value > 0.0:
            signal["speckle_shape"], signal["speckle_scale"] = 1.0 / law.relative.value, law.relative.value
    return signal
