# SPDX-License-Identifier: Apache-2.0
"""The sensor's configuration in the engines' terms."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

import simsense
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.lens import is_distorting, lens_fields
from activestereo.common.matcher_table import MATCHER, RIG
from activestereo.common.parameter import Parameter
from activestereo.common.pose import Pose, camera_to_camera
from activestereo.common.render_table import RENDER, RENDERER

# SAPIEN's noise at scale 1: a gamma factor of shape 1333.33 and mean 1, and Gaussian noise of 0.25 counts.
SPECKLE_SHAPE = 1333.33
THERMAL_SIGMA_DN = 0.25


class Taken(NamedTuple):
    """Facts of a picture, beside its images, that matching depends on."""

    frame: int = -1
    speckle_draw: int = -1
    is_laser_apart: bool = False


def signal_parameters(config: StereoDepthSensorConfig) -> dict[str, float]:
    """Both imagers' parameters, all of them: ir_signal or SAPIEN's noise, with the exposure, responsivity and black
    level."""
    signal = config.ir_signal
    if isinstance(signal, str):
        signal = simsense.signal_preset(signal)  # type: ignore[arg-type]  # the engine knows them, and says so
    signal = simsense.signal_preset("neutral") | (_sapien_noise(config) if signal is None else signal)
    signal["exposure_s"] = config.ir_camera_exposure
    signal["gain"] *= config.ir_camera_gain
    signal["responsivity_e"] *= config.ir_responsivity_dn
    signal["black_level_dn"] += config.ir_black_level_dn
    return signal


def _sapien_noise(config: StereoDepthSensorConfig) -> dict[str, float]:
    speckle, thermal = config.ir_speckle_noise, config.ir_thermal_noise
    if speckle < 0 or (speckle > 0 and thermal <= 0):
        raise ValueError(
            f"noise scales must be positive, or ir_speckle_noise 0 for none; they are {speckle} and {thermal}"
        )
    if speckle == 0:
        return {"speckle_shape": 0.0, "speckle_scale": 0.0, "adc_noise_dn": 0.0}
    return {
        "speckle_shape": SPECKLE_SHAPE / speckle,
        "speckle_scale": speckle / SPECKLE_SHAPE,
        "adc_noise_dn": THERMAL_SIGMA_DN * thermal,
    }


def _values(config: StereoDepthSensorConfig, table: Sequence[Parameter]) -> dict[str, Any]:
    """The configuration's values under the engine's names."""
    return {p.name: getattr(config, p.name) for p in table}


def rig_parameters(config: StereoDepthSensorConfig) -> dict[str, Any]:
    """Where and how the depth engine works."""
    return _values(config, RIG)


def renderer_parameters(config: StereoDepthSensorConfig) -> dict[str, Any]:
    """Keyword arguments of kuafu.Renderer."""
    return _values(config, RENDERER)


def render_parameters(config: StereoDepthSensorConfig) -> dict[str, Any]:
    """Keyword arguments of kuafu.Renderer.render, those that a sensor does not decide itself."""
    return _values(config, RENDER)


def matcher_parameters(config: StereoDepthSensorConfig) -> dict[str, Any]:
    """The stereo matcher's parameters under the engine's names."""
    return _values(config, MATCHER)


def engine_parameters(config: StereoDepthSensorConfig) -> dict[str, Any]:
    """Keyword arguments of simsense.Engine, the imagers' included."""
    return matcher_parameters(config) | signal_parameters(config)


def make_engine(config: StereoDepthSensorConfig, device: simsense.Device, batch_count: int = 1) -> simsense.Engine:
    """A depth engine of the configuration's rig and parameters, for batch_count pairs at a time."""
    (width, height), (rgb_width, rgb_height) = config.ir_resolution, config.rgb_resolution
    (k_left, lens_left), (k_right, lens_right) = config.ir_intrinsics(False), config.ir_intrinsics(True)
    is_distorted = is_distorting(lens_left) or is_distorting(lens_right)
    return simsense.Engine(
        device,
        simsense.Camera(width, height, k_left, **lens_fields(lens_left)),
        simsense.Camera(width, height, k_right, **lens_fields(lens_right)),
        camera_to_camera(config.trans_pose_l, config.trans_pose_r),
        rgb=simsense.Camera(rgb_width, rgb_height, config.rgb_intrinsic, **lens_fields(config.rgb_distortion)),
        left_to_rgb=camera_to_camera(config.trans_pose_l, Pose()),
        rectified=config.rectified and not is_distorted,
        batch_count=batch_count,
        noise_seed=config.noise_seed,
        **rig_parameters(config),
        **engine_parameters(config),
    )


def linear_counts(image: np.ndarray, signal: dict[str, float]) -> np.ndarray:
    """Counts over full scale, 0..1, of a linear imager without noise and dark current for an image of radiance."""
    full_scale_dn = 2 ** signal["bit_depth"] - 1
    per_radiance = signal["exposure_s"] * signal["responsivity_e"] * signal["conversion_gain_dn_per_e"] * signal["gain"]
    warming_k = signal["temperature_c"] - signal["dark_reference_c"]
    black_dn = signal["black_level_dn"] + signal["black_level_dn_per_k"] * warming_k
    return np.clip(image * np.float32(per_radiance / full_scale_dn) + np.float32(black_dn / full_scale_dn), 0.0, 1.0)
