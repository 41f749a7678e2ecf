# SPDX-License-Identifier: Apache-2.0
"""Renders single exposures of a sensor in a loaded scene, under settings that change. The scene stays loaded; the
sensor is made anew for each picture, which takes a fiftieth of a second."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.plan import pattern_of
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.lens import disparity_of, is_distorting
from activestereo.common.pose import body_pose
from activestereo.model import SensorModel
from activestereo.report.view.settings import SURFACE_FIELDS, Settings
from activestereo.sensor.image_effects import ModelCostWarning
from activestereo.sensor.sensor import StereoDepthSensor

# A draft has noisy bounced light but exact dots, and so exact depth. It is not denoised,
# which would take four fifths of its time on a processor.
_DRAFT = {"samples_per_pixel": 2, "max_bounces": 2, "denoise": "none"}
# Under these effects light scatters in the air or below surfaces, so that a sample takes at least twice as long.
_FEW_SAMPLES = {"samples_per_pixel": 1}
_SCATTERING = {"haze": _FEW_SAMPLES | {"max_bounces": 1}, "subsurface": _FEW_SAMPLES, "transmission": _FEW_SAMPLES}
_REFINED_SAMPLES = 64


@dataclass(frozen=True)
class Exposure:
    """The sensor and its pose for one exposure, before the page's settings. config: from drawn_from_left(), with the
    left infrared camera in the colour camera's place. model: known effects of the sensor. camera_to_world: the left
    camera's pose, 4x4.

    room_radiance: infrared radiance from all sides, W/(sr m^2); None for the scene's own. twist: the camera's velocity,
    (6,) m/s and rad/s, as a frame's camera_velocity.
    """

    config: StereoDepthSensorConfig
    model: SensorModel
    camera_to_world: NDArray[np.float64]
    room_radiance: float | None = None
    temperature_c: float | None = None
    time_s: float = 0.0
    twist: NDArray[np.float64] = field(default_factory=lambda: np.zeros(6))


@dataclass(frozen=True)
class Pictures:
    """An infrared pair and its disparity. left, right: DN, float32 [height][width]. disparity: of the left image,
    pixels, NaN = none. render_s: the time that a simulation took."""

    left: NDArray[np.float32]
    right: NDArray[np.float32]
    disparity: NDArray[np.float32]
    exposure_s: float | None = None
    gain: float | None = None
    render_s: float = 0.0


class Superseded(Exception):
    """Raised if the page no longer waits for this picture."""


class Simulation:
    """Renders exposures of a loaded scene, one at a time."""

    def __init__(self, scene: kuafu.Scene) -> None:
        self._scene = scene
        self._one_at_a_time = threading.Lock()

    def material_names(self) -> list[str]:
        return [self._scene.material_name(number) for number in range(self._scene.summary.material_count)]

    def picture(
        self, exposure: Exposure, settings: Settings, is_draft: bool, is_wanted: Callable[[], bool]
    ) -> Pictures:
        """Renders the exposure under these settings. is_draft: few samples, so that it takes little time. Raises
        Superseded if is_wanted() turns false before or during the render."""
        begin = perf_counter()
        with self._one_at_a_time:
            if not is_wanted():
                raise Superseded
            try:
                with self._sensor(exposure, settings, is_draft) as sensor:
                    sensor.take_picture(infrared_only=True, progress=lambda _: not is_wanted())
                    return _pictures(sensor, begin)
            except kuafu.CancelledError as error:
                raise Superseded from error

    def surface(self, exposure: Exposure, settings: Settings, u: int, v: int) -> tuple[str, dict[str, float]] | None:
        """Returns (material name, {field of SURFACE_FIELDS: its value}) at pixel u, v of the left image; None if no
        surface is there."""
        with self._one_at_a_time, self._sensor(exposure, settings, is_draft=True) as sensor:
            numbers = sensor.get_picture("material_id", "left")[..., 0]
            materials = [self._scene.get_material(n) for n in range(self._scene.summary.material_count)]
        names = self.material_names()
        height, width = numbers.shape
        if not (0 <= u < width and 0 <= v < height):
            raise ValueError(f"there is no pixel u {u}, v {v} in an image of {width}x{height}")
        number = int(numbers[v, u])
        if number >= len(names):
            return None
        values = {name: getattr(materials[number], name) for name in SURFACE_FIELDS}
        if values["ir_albedo"] is None:
            values["ir_albedo"] = materials[number].base_color[0]
        return names[number], values

    def _sensor(self, exposure: Exposure, settings: Settings, is_draft: bool) -> StereoDepthSensor:
        config, model = settings.applied(deepcopy(exposure.config), exposure.model)
        quality = dict(_DRAFT) if is_draft else {"samples_per_pixel": _REFINED_SAMPLES}
        for entry in model.effects if is_draft else ():
            quality |= _SCATTERING.get(entry.effect.id, {})
        for name, value in quality.items():
            setattr(config, name, value)
        if exposure.room_radiance is not None:
            self._scene.set_environment((exposure.room_radiance,) * 3, ir_radiance=exposure.room_radiance)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelCostWarning)
            sensor = StereoDepthSensor(config, self._scene, body_pose(exposure.camera_to_world), model=model)
        sensor.set_conditions(exposure.temperature_c, exposure.time_s)
        if any(entry.effect.family == "motion" for entry in model.effects):  # else no motion, as in the lab
            sensor.set_velocity(exposure.twist[:3], exposure.twist[3:])
        return sensor


def drawn_from_left(config: StereoDepthSensorConfig) -> StereoDepthSensorConfig:
    """Returns the configuration with the left infrared camera in the colour camera's place. Its pattern is drawn here,
    once for all pictures."""
    out, drawn = config.seen_from_left(), pattern_of(config)
    out.light_pattern = None if drawn is None else drawn[0]
    return out


def _pictures(sensor: StereoDepthSensor, begin: float) -> Pictures:
    sensor.compute_depth(("disparity", "ir_left", "ir_right"))
    config = sensor.get_config()
    left, right = (image.astype(np.float32) for image in sensor.get_ir_measured())
    if config.rectified and not is_distorting(config.ir_distortion):
        # Registration would remove sub-pixel positions.
        disparity = sensor.get_disparity()
        disparity = np.where(disparity > 0, disparity, np.float32(np.nan))
    else:
        disparity = disparity_of(sensor.get_depth(), config.focal_baseline_px_m)
    exposure_s, gain = float(config.ir_camera_exposure), float(config.ir_camera_gain)
    return Pictures(left, right, disparity, exposure_s, gain, perf_counter() - begin)
