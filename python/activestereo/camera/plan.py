# SPDX-License-Identifier: Apache-2.0
"""Converts a sensor's configuration to the engines' inputs, once, when the sensor is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import simsense
from activestereo.camera.auto_exposure import AutoExposure, Setting
from activestereo.camera.config_limits import check_together
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.images import read_gray
from activestereo.common.lens import is_distorting, is_drawn, lens_fields, to_pixels, to_tangents
from activestereo.common.parameter import MATCHER, RENDER, RENDERER, RIG, SIGNAL, Parameter
from activestereo.common.pattern import make_pattern
from activestereo.common.pose import Pose, camera_to_camera, camera_to_world

# SAPIEN's noise at scale 1: a gamma factor of shape 1333.33 and mean 1, and Gaussian noise of 0.25 counts.
SPECKLE_SHAPE = 1333.33
THERMAL_SIGMA_DN = 0.25
# Focus distance of a collimated beam. A dot is then the beam's width in metres, widened by its angle.
_FAR_M = 1e6


class Pattern(NamedTuple):
    """A projector's pattern. image: uint8 [height, width]. radiant: the image as relative radiant intensity 0..1,
    float32 and read-only."""

    image: NDArray[np.uint8]
    radiant: NDArray[np.float32]


@dataclass(frozen=True)
class SensorPlan:
    """Inputs of the renderer, imagers, rectification, matcher and registration for one sensor. The RGB camera's frame
    is the world. Each dict holds keyword arguments of the function named here.

    config: the sensor's configuration, for the fields that need no conversion. rgb, left, right: kuafu.Camera's,
    without velocities and the infrared exposure. left_to: 4x4 from the left camera's axes to those of 'rgb', 'left',
    'right' and 'projector'. projector: kuafu.Light's without its intensity; None without a projector. pattern: the
    projector's image; None if it has dots. laser_w_sr: the projector's intensity in even and in odd pictures. renderer,
    render: those of kuafu.Renderer and its render(). engine: simsense.Engine's, without the imagers. signal: the
    imagers' parameters at gain 1."""

    config: StereoDepthSensorConfig
    rgb: dict[str, Any]
    left: dict[str, Any]
    right: dict[str, Any]
    left_to: dict[str, NDArray[np.float64]]
    projector: dict[str, Any] | None
    pattern: Pattern | None
    laser_w_sr: tuple[float, float]
    renderer: dict[str, Any]
    render: dict[str, Any]
    render_seed: int
    engine: dict[str, Any]
    signal: dict[str, float]
    exposure: AutoExposure


def plan_of(config: StereoDepthSensorConfig) -> SensorPlan:
    """Makes the SensorPlan of a configuration. Raises ValueError if its fields contradict one another."""
    pattern = _pattern(config) if config.light_dots is None else None
    check_together(vars(config))
    seen = {
        "rgb": (config.rgb_resolution, config.rgb_intrinsic, config.rgb_distortion),
        "left": (config.ir_resolution, *ir_intrinsics(config, is_right=False)),
        "right": (config.ir_resolution, *ir_intrinsics(config, is_right=True)),
    }
    cameras: dict[str, dict[str, Any]] = {
        name: {"width": width, "height": height, "k": np.array(k, np.float64), **lens_fields(lens)}
        for name, ((width, height), k, lens) in seen.items()
    }
    is_distorted = is_distorting(seen["left"][2]) or is_distorting(seen["right"][2])
    # A line time of 0 is a global shutter.
    ir_shutter, rgb_shutter = (
        {"shutter": "rolling", "line_time_s": line_time_s, "readout": readout} if line_time_s else dict[str, Any]()
        for line_time_s, readout in (
            (config.ir_line_time_s, config.ir_readout),
            (config.rgb_line_time_s, config.rgb_readout),
        )
    )
    lit = config.projector_intensity * (config.laser_power_mw / config.laser_power_nominal_mw)
    laser_w_sr = {"on": (lit, lit), "off": (0.0, 0.0), "alternating": (lit, 0.0)}[config.emitter]
    exposure = AutoExposure(
        config.ir_exposure_mode, Setting(float(config.ir_camera_exposure), float(config.ir_camera_gain)),
        float(config.ir_exposure_target_dn), config.ir_exposure_limits_s, config.ir_gain_limits,
        config.ir_exposure_region,
    )  # fmt: skip
    projector = _projector(config, pattern)
    places = {"left": config.trans_pose_l, "right": config.trans_pose_r, "projector": config.pose_rgb_irproj}
    on_rig = {name: camera_to_world(Pose() * place) for name, place in places.items()}
    left_to = {name: camera_to_camera(places["left"], place) for name, place in (places | {"rgb": Pose()}).items()}
    matching: dict[str, Any] = {name: simsense.Camera(**camera) for name, camera in cameras.items()}
    matching |= {"left_to_right": left_to["right"], "left_to_rgb": left_to["rgb"], "noise_seed": config.noise_seed}
    matching["rectified"] = config.rectified and not is_distorted
    return SensorPlan(
        config=config,
        rgb=cameras["rgb"] | rgb_shutter | {"exposure_s": config.rgb_exposure_s},
        left=cameras["left"] | ir_shutter | {"camera_to_world": on_rig["left"]},
        right=cameras["right"] | ir_shutter | {"camera_to_world": on_rig["right"]},
        left_to=left_to,
        projector=projector and projector | {"light_to_world": on_rig["projector"]},
        pattern=pattern,
        laser_w_sr=laser_w_sr,
        renderer=parameters(config, RENDERER),
        render=parameters(config, RENDER),
        render_seed=config.render_seed,
        engine=matching | parameters(config, RIG) | matcher_parameters(config),
        signal=signal_parameters(config),
        exposure=exposure,
    )


def parameters(config: StereoDepthSensorConfig, table: Sequence[Parameter]) -> dict[str, Any]:
    """Returns {name: the configuration's value} of all engine parameters in a table."""
    return {p.name: getattr(config, p.name) for p in table}


def matcher_parameters(config: StereoDepthSensorConfig) -> dict[str, Any]:
    """Returns {parameter: value} of the stereo matcher. Its detection threshold needs the images' noise, also that of
    recorded images. If the configuration leaves this noise at 0, it is that of the imager's parameters at gain 1."""
    out = parameters(config, MATCHER)
    if out["min_detection_sigma"] > 0.0 and out["noise_dn2"] == out["noise_dn2_per_dn"] == 0.0:
        signal = signal_parameters(config)
        shot = signal["conversion_gain_dn_per_e"] * signal["shot_noise"] ** 2
        still = signal["adc_noise_dn"] ** 2 + (signal["conversion_gain_dn_per_e"] * signal["read_noise_e"]) ** 2
        out |= {"noise_dn2": still - shot * signal["black_level_dn"], "noise_dn2_per_dn": shot}
    return out


def ir_intrinsics(config: StereoDepthSensorConfig, is_right: bool) -> tuple[np.ndarray, Sequence[float]]:
    """Returns (3x3 K, distortion coefficients) of the left or the right infrared camera."""
    k, lens = (config.ir_intrinsic_right, config.ir_distortion_right) if is_right else (None, None)
    return config.ir_intrinsic if k is None else k, config.ir_distortion if lens is None else lens


def signal_parameters(config: StereoDepthSensorConfig) -> dict[str, float]:
    """Returns all parameters of both infrared imagers at gain 1. The configuration's responsivity and black level are
    included."""
    signal = simsense.signal_preset("neutral") | stated_signal(config)
    signal["responsivity_e"] *= config.ir_responsivity_dn
    signal["black_level_dn"] += config.ir_black_level_dn
    return signal


def stated_signal(config: StereoDepthSensorConfig) -> dict[str, float]:
    """Returns the parameters of ir_signal, or those of SAPIEN's noise if that is None; others are neutral."""
    signal = config.ir_signal
    if isinstance(signal, str):
        return simsense.signal_preset(signal)  # type: ignore[arg-type]  # the engine knows them, and says so
    if signal is not None:
        return dict(signal)
    speckle = config.ir_speckle_noise
    if speckle == 0:
        return {"speckle_shape": 0.0, "speckle_scale": 0.0, "adc_noise_dn": 0.0}
    return {
        "speckle_shape": SPECKLE_SHAPE / speckle,
        "speckle_scale": speckle / SPECKLE_SHAPE,
        "adc_noise_dn": THERMAL_SIGMA_DN * config.ir_thermal_noise,
    }


# An imager's noise terms.
_NOISE = ("hot_pixel_share", *(p.name for p in SIGNAL if p.is_noise))


def remove_noise(config: StereoDepthSensorConfig) -> None:
    """Switches the imagers' noise off. What else ir_signal states stays: gains, response, black level, bits."""
    config.ir_signal = stated_signal(config) | dict.fromkeys(_NOISE, 0.0)
    config.ir_speckle_noise, config.ir_thermal_noise, config.ir_speckle_of_laser = 1.0, 1.0, False


def pattern_of(config: StereoDepthSensorConfig) -> tuple[NDArray[np.uint8], NDArray[np.float64]] | None:
    """Returns (the projector's image as uint8 [height, width], its 3x3 K), or None without a projector image."""
    pattern = _pattern(config)
    return None if pattern is None else (pattern.image, pattern_k(config, *pattern.image.shape[::-1]))


def _pattern(config: StereoDepthSensorConfig) -> Pattern | None:
    image: Any = config.light_pattern
    if image is None:
        return None
    if not isinstance(image, np.ndarray):
        image = make_pattern(config.pattern_design) if image == "generated" else read_gray(image, key="light_pattern")
    radiant = image.astype(np.float32) / np.float32(255.0)
    radiant.flags.writeable = False
    return Pattern(image, radiant)


def pattern_k(config: StereoDepthSensorConfig, width: int, height: int) -> np.ndarray:
    """Returns the projector's 3x3 K in pixels of a pattern image of this size."""
    if config.pattern_intrinsic is not None:
        return np.array(config.pattern_intrinsic, dtype=np.float64)
    focal = 0.5 * width / np.tan(0.5 * config.active_light_fov)
    return np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])


def _projector(config: StereoDepthSensorConfig, pattern: Pattern | None) -> dict[str, Any] | None:
    """Returns keyword arguments of kuafu.Light without its pose and intensity; None without dots and image."""
    fields: dict[str, Any] = {"kind": "projector", "name": "projector"}
    fields |= {"falloff": config.projector_falloff, "pattern_scale": config.light_pattern_scale}
    if config.projector_beam_radius_m > 0.0:
        fields |= {"radius_m": config.projector_beam_radius_m, "focus_m": _FAR_M}
    if config.light_dots is not None:
        design = config.pattern_design
        dots: dict[str, Any] = {"dots": config.light_dots, "dot_background": config.light_dot_background}
        dots |= {"pattern_width": design.width, "pattern_height": design.height, "dot_sigma_px": design.dot_sigma_px}
        return fields | dots | {"k": pattern_k(config, design.width, design.height)}
    return None if pattern is None else fields | {"k": pattern_k(config, *pattern.image.shape[::-1])}


def registered(
    depth_m: NDArray[np.float32], k: NDArray[np.float64], left_to_rectified: NDArray[np.float64], plan: SensorPlan
) -> NDArray[np.float32]:
    """Returns depth registered to the RGB camera, float32 [height, width], metres, 0 = none. Each point falls on its
    nearest pixel; the nearest surface wins. With depth_dilation, a point also covers the pixels up and left of it.
    depth_m: of the rectified left image, metres. k: that image's 3x3. left_to_rectified: 4x4 from the left camera's
    axes to the rectified ones."""
    rgb, matcher, left_to_rgb = plan.rgb, plan.engine, plan.left_to["rgb"]
    v, u = np.nonzero(depth_m)
    z = depth_m[v, u].astype(np.float64)
    x, y = to_tangents(u, v, k)
    points = np.stack([x * z, y * z, z])
    rotation, offset = left_to_rgb[:3, :3] @ left_to_rectified[:3, :3].T, left_to_rgb[:3, 3:]
    x, y, z = rotation @ points + offset
    ahead = z > 0
    x, y, z = x[ahead] / z[ahead], y[ahead] / z[ahead], z[ahead]
    if is_distorting(rgb["distortion"]):
        drawn = is_drawn(x, y, rgb["distortion"])
        x, y, z = x[drawn], y[drawn], z[drawn]
    width, height = rgb["width"], rgb["height"]
    column, row = (np.rint(place).astype(int) for place in to_pixels(x, y, rgb["k"], rgb["distortion"]))
    out = np.full((height, width), np.inf, np.float32)
    covered = (0, 1) if matcher["depth_dilation"] else (0,)
    for down in covered:
        for right in covered:
            r, c = row - down, column - right
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            np.minimum.at(out, (r[inside], c[inside]), z[inside].astype(np.float32))
    out[~np.isfinite(out) | (out < matcher["min_depth_m"]) | (out >= matcher["max_depth_m"])] = 0.0
    return out
