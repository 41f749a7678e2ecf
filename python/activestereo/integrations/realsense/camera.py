# SPDX-License-Identifier: Apache-2.0
"""Simulates the camera behind a device: a scene, and a sensor that librealsense's options configure."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kuafu
from activestereo.camera.advanced_mode.settings import (
    AdvancedSettings,
    camera_fields,
    depth_table,
    matcher_parameters,
    visual_preset,
)
from activestereo.camera.plan import matcher_parameters as matcher_of
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.limits import Limits
from activestereo.common.pose import Pose, body_pose, camera_to_camera
from activestereo.integrations.realsense.frames import StreamRequest, intrinsics, video_stream_profile
from activestereo.integrations.realsense.options import (
    distortion,
    format,
    frame_metadata_value,
    option,
    option_range,
    rs400_visual_preset,
    stream,
)
from activestereo.scene_io.example_scene import write_table_top
from activestereo.sensor.mounts import as_mount
from activestereo.sensor.sensor import StereoDepthSensor

_GAIN_STEPS = 16  # librealsense's gain is 16 times ours
_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601
# Time from the middle of the exposure to the arrival, measured on D400s.
LATENCY_MS: dict[stream, float] = {stream.depth: 9.0, stream.infrared: 9.0, stream.color: 66.0}


@dataclass
class World:
    """Describes the world that a simulated camera sees, and how its frames are delivered. scene: a scene file, or None
    for the example's table top. pose: the RGB camera's pose in the scene, body axes; None: the pose of the scene's
    first camera. before_frame: called with the sensor and the time in seconds before each picture, to move objects.
    jitter_ms: standard deviation of the latency. drop_share: share of each stream's frames that are lost. seed: repeats
    both. frames: after so many frames none arrives, and waiting fails as with an unplugged camera; None: no end."""

    scene: str | os.PathLike[str] | kuafu.Scene | None = None
    sensor: str = "D435"
    pose: Pose | None = None
    before_frame: Callable[[StereoDepthSensor, float], object] = lambda sensor, time_s: None
    latency_ms: Mapping[stream, float] = field(default_factory=lambda: dict(LATENCY_MS))
    jitter_ms: float = 0.0
    drop_share: float = 0.0
    frames: int | None = None
    seed: int = 0
    device: str | int | kuafu.Device = "auto"
    samples_per_pixel: int = 16
    serial_number: str = "000000000000"

    def __post_init__(self) -> None:
        """Raises ValueError for numbers that describe no delivery."""
        Limits(0.0, 0.999).check("drop_share", self.drop_share)
        Limits(0.0, 1e9, "ms").check("jitter_ms", self.jitter_ms)
        for name, late_ms in self.latency_ms.items():
            Limits(0.0, 1e9, "ms").check(f"latency_ms of {name}", late_ms)
        if self.frames is not None:
            Limits(0, 2**63, whole=True).check("frames", self.frames)


def sensor_ranges(config: StereoDepthSensorConfig) -> dict[option, option_range]:
    """Returns {option: its range} for the depth sensor, with the options of a D400."""
    low, high, step = config.laser_power_limits_mw
    exposure = round(1e6 * config.ir_camera_exposure)
    return {
        option.exposure: option_range(1, 200000, 1, exposure),
        option.gain: option_range(16, 248, 1, 16),
        option.enable_auto_exposure: option_range(0, 1, 1, float(config.ir_exposure_mode != "fixed")),
        option.visual_preset: option_range(0, 5, 1, 0),
        option.laser_power: option_range(low, high, step, config.laser_power_mw),
        option.emitter_enabled: option_range(0, 2, 1, 1),
        option.emitter_on_off: option_range(0, 1, 1, 0),
        option.depth_units: option_range(1e-6, 0.01, 1e-6, 0.001),
        option.frames_queue_size: option_range(0, 32, 1, 16),
    }


class SimulatedCamera:
    """Takes pictures of a world under librealsense's options. depth_size, color_size: (width, height) of the
    streams."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.base = StereoDepthSensorConfig(world.sensor)
        self.base.samples_per_pixel = world.samples_per_pixel
        self.baseline_m = self.base.baseline_m
        self.settings = AdvancedSettings({})
        self.values = {which: r.default for which, r in sensor_ranges(self.base).items()}
        self.depth_size = self.own_depth_size = self.base.ir_resolution
        self.color_size = self.own_color_size = self.base.rgb_resolution
        # Returns the pipeline that the camera streams to, or None; one at a time.
        self.streams_to: Callable[[], object | None] = lambda: None
        self._scene: kuafu.Scene | None = None
        self._sensor: StereoDepthSensor | None = None
        self._config: StereoDepthSensorConfig | None = None  # time of the next picture
        self._made_for: StereoDepthSensorConfig | None = None

    # ---- settings of the options ----

    def set_option(self, which: option, value: float) -> None:
        """Sets an option from the next picture on. A preset sets the advanced-mode settings; exposure and gain end
        automatic exposure."""
        if which == option.visual_preset:
            self.set_settings(visual_preset(rs400_visual_preset(int(value)).name))
        if which in (option.exposure, option.gain):
            self.values[option.enable_auto_exposure] = 0.0
        self.values[which] = value
        self._config = None

    def set_settings(self, settings: AdvancedSettings) -> None:
        """Sets advanced-mode settings from the next picture on."""
        table = depth_table(settings)  # refuses clamps that exclude all
        if "param-depthunits" in settings.values:
            self.values[option.depth_units] = table.unit_m
        self.settings, self._config = settings, None

    def config(self) -> StereoDepthSensorConfig:
        """Returns the sensor's configuration under the present options."""
        if self._config is None:
            # A mode with another aspect ratio is a crop of the camera's own image.
            config, colored = _cut(self.base, "ir", self.depth_size), _cut(self.base, "rgb", self.color_size)
            for name in ("rgb_resolution", "rgb_intrinsic", "rgb_line_time_s", "rgb_optics"):
                setattr(config, name, getattr(colored, name))
            values = self.values
            if not values[option.enable_auto_exposure]:
                config.ir_exposure_mode = "fixed"
                config.ir_camera_exposure = 1e-6 * values[option.exposure]
                config.ir_camera_gain = values[option.gain] / _GAIN_STEPS
            config.laser_power_mw = values[option.laser_power]
            if not values[option.emitter_enabled]:
                config.emitter = "off"
            elif values[option.emitter_on_off]:
                config.emitter = "alternating"
            set_here = matcher_parameters(self.settings, matcher_of(config)) | camera_fields(self.settings)
            for name, value in set_here.items():
                setattr(config, name, value)
            self._config = config
        return self._config

    def profile(self, request: StreamRequest) -> video_stream_profile:
        """Returns the stream profile for a request; a request without a size gets the present size."""
        name, size = ("rgb", self.color_size) if request.stream == stream.color else ("ir", self.depth_size)
        size = (request.width, request.height) if request.width and request.height else size
        c, left_to_stream = _cut(self.base, name, size), np.eye(4)
        K, lens = getattr(c, f"{name}_intrinsic"), [float(n) for n in getattr(c, f"{name}_distortion")[:5]]
        if request.stream == stream.color:
            left_to_stream = np.asarray(camera_to_camera(c.trans_pose_l, Pose()))
        elif request.stream == stream.infrared and request.index == 2:
            left_to_stream = np.asarray(camera_to_camera(c.trans_pose_l, c.trans_pose_r))
        return video_stream_profile(
            replace(request, width=size[0], height=size[1]),
            intrinsics(*size, K[0, 2], K[1, 2], K[0, 0], K[1, 1], distortion.brown_conrady, lens),
            left_to_stream,
            self.baseline_m,
        )

    # ---- pictures ----

    def take_picture(self, time_s: float, with_color: bool) -> None:
        """Takes the picture at time_s, seconds, and computes its depth; the results stay until the next picture."""
        sensor = self._ready()
        self.world.before_frame(sensor, time_s)
        sensor.take_picture(infrared_only=not with_color)
        sensor.compute_depth()

    def depth(self) -> NDArray[np.uint16]:
        """Returns depth in the left infrared camera, uint16 counts of the option depth_units; 0 = no measurement."""
        sensor, table = self._ready(), depth_table(self.settings)
        disparity = sensor.get_disparity()
        with np.errstate(divide="ignore"):
            z = np.where(disparity > 0, self.config().focal_baseline_px_m / disparity, 0.0)
        z = np.where((z >= table.min_depth_m) & (z < table.max_depth_m), z, 0.0)
        counts = np.rint(z / self.values[option.depth_units])
        return np.where(counts <= np.iinfo(np.uint16).max, counts, 0).astype(np.uint16)

    def pixels(self, profile: video_stream_profile) -> NDArray[Any]:
        """Returns a stream's image from the last picture, in the profile's format."""
        if profile.stream_type() == stream.depth:
            return self.depth()
        if profile.stream_type() == stream.infrared:
            image = self._ready().get_ir_measured()[profile.stream_index() - 1]
            return np.asarray(image if image.dtype == np.uint8 else image >> 8, np.uint8)
        rgba, form = self._ready().get_rgba8(), profile.format()
        if form == format.y8:
            return np.rint(rgba[..., :3] @ _LUMA).astype(np.uint8)
        order = [0, 1, 2] if form in (format.rgb8, format.rgba8) else [2, 1, 0]
        if form not in (format.rgba8, format.bgra8):
            return np.ascontiguousarray(rgba[..., order])
        return np.dstack([rgba[..., order], np.full(rgba.shape[:2], 255, np.uint8)])

    def light(self) -> dict[frame_metadata_value, int]:
        """Returns metadata of the last picture: the infrared cameras' exposure in microseconds and gain, and the
        laser's state."""
        sensor = self._ready()
        used, is_lit = sensor.get_config(), sensor.plan.laser_w_sr[sensor.frame_index % 2] > 0
        return {
            frame_metadata_value.actual_exposure: round(1e6 * used.ir_camera_exposure),
            frame_metadata_value.gain_level: round(_GAIN_STEPS * used.ir_camera_gain),
            frame_metadata_value.frame_laser_power: round(self.config().laser_power_mw),
            frame_metadata_value.frame_laser_power_mode: int(is_lit),
            frame_metadata_value.auto_exposure: int(self.values[option.enable_auto_exposure]),
        }

    def close(self) -> None:
        if self._sensor is not None:
            self._sensor.close()
        self._sensor = None

    def _ready(self) -> StereoDepthSensor:
        """Returns the sensor for the present configuration; makes a new one after a change."""
        config = self.config()
        if self._sensor is None or self._made_for is not config:
            self.close()
            if self._scene is None and self.world.scene is not None:
                self._scene = as_mount(self.world.scene, self.world.device).scene
            elif self._scene is None:
                with TemporaryDirectory(prefix="activestereo.") as folder:
                    path = Path(folder) / "table_top.gltf"
                    write_table_top(path)
                    self._scene = as_mount(path, self.world.device).scene
            scene = self._scene
            pose = self.world.pose
            if pose is None:
                pose = body_pose(scene.camera(0).camera_to_world) if scene.summary.camera_count else Pose()
            self._sensor = StereoDepthSensor(config, scene, pose, self.world.device)
            self._made_for = config
        return self._sensor


def _cut(base: StereoDepthSensorConfig, camera: str, size: tuple[int, int]) -> StereoDepthSensorConfig:
    own = getattr(base, f"{camera}_resolution")
    if size == own:
        return deepcopy(base)
    factor = max(size[0] / own[0], size[1] / own[1])
    focal_px = factor * getattr(base, f"{camera}_intrinsic")[0, 0]
    return base.resized(*size, fov=float(np.rad2deg(2 * np.arctan(0.5 * size[0] / focal_px))))
