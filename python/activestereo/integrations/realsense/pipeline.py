# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's context, devices and sensors of one simulated camera, and its pipeline: framesets of the streams that
a config asks for, one simulated picture each."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.advanced_mode import AdvancedSettings
from activestereo.camera.advanced_mode.settings import parse_settings
from activestereo.integrations.realsense.camera import SimulatedCamera, World, sensor_ranges
from activestereo.integrations.realsense.enums import camera_info, format, frame_metadata_value, option, stream
from activestereo.integrations.realsense.frames import (
    StreamRequest,
    composite_frame,
    depth_frame,
    frame,
    video_frame,
    video_stream_profile,
)
from activestereo.integrations.realsense.options import Options, controls, group_of, with_group

_PRODUCT_IDS = {"D405": "0B5B", "D415": "0AD3", "D435": "0B07", "D435I": "0B3A", "D455": "0B5C"}
_SIZES, _FPS = ((640, 480), (848, 480), (1280, 720)), 30
_worlds: list[World] = []


def simulate(world: World) -> None:
    """Sets the world for cameras of this module; running pipelines keep theirs."""
    _worlds[:] = [world]


class sensor(Options):
    """One of a device's sensors. modes: of each stream and index, its formats."""

    modes: dict[tuple[stream, int], tuple[format, ...]] = {(stream.color, 0): (format.rgb8, format.bgr8)}

    def __init__(self, name: str, camera: SimulatedCamera, *args: Any) -> None:
        super().__init__(*args)
        self.name, self._camera = name, camera

    def get_stream_profiles(self) -> list[video_stream_profile]:
        """The usual modes; a pipeline takes any size."""
        return [
            video_stream_profile(
                StreamRequest(kind, index, *size, form, _FPS),
                self._camera.lens(kind, size),
                self._camera.left_to(kind, index),
                self._camera.baseline_m,
            )
            for (kind, index), forms in self.modes.items()
            for size in _SIZES
            for form in forms
        ]

    def get_info(self, which: int) -> str:
        if which != camera_info.name:
            raise RuntimeError(f"info {which} not supported by the device")
        return self.name


class depth_sensor(sensor):
    modes = {(stream.depth, 0): (format.z16,), (stream.infrared, 1): (format.y8,), (stream.infrared, 2): (format.y8,)}

    def __init__(self, camera: SimulatedCamera) -> None:
        ranges = sensor_ranges(camera.base)
        baseline_mm = 1e3 * camera.baseline_m
        super().__init__("Stereo Module", camera, ranges, {option.stereo_baseline: baseline_mm}, camera.set_option)

    def set_option(self, which: option, value: float) -> None:
        """As in librealsense, setting an exposure or gain ends automatic exposure."""
        super().set_option(which, value)
        if which in (option.exposure, option.gain):
            self._values[option.enable_auto_exposure] = 0.0

    def get_depth_scale(self) -> float:
        """Metres per count."""
        return self._camera.unit_m


class device:
    def __init__(self, camera: SimulatedCamera | None = None) -> None:
        self.camera = camera or SimulatedCamera(_worlds[0] if _worlds else World.of_environment())
        self._depth, self._color = depth_sensor(self.camera), sensor("RGB Camera", self.camera, {})
        model = self.camera.base.model.upper().removeprefix("SAPIEN-")
        self._info = {
            camera_info.name: f"Intel RealSense {model} (simulated)",
            camera_info.serial_number: "000000000000",
            camera_info.firmware_version: "5.16.0.1",
            camera_info.physical_port: "simulated",
            camera_info.advanced_mode: "YES",
            camera_info.product_id: _PRODUCT_IDS.get(model, "0B07"),
            camera_info.usb_type_descriptor: "3.2",
            camera_info.product_line: "D400",
        }

    def supports(self, which: int) -> bool:
        return which in self._info

    def get_info(self, which: int) -> str:
        if which not in self._info:
            raise RuntimeError(f"info {which} not supported by the device")
        return self._info[which]

    def query_sensors(self) -> list[sensor]:
        return [self._depth, self._color]

    sensors = property(query_sensors)

    def first_depth_sensor(self) -> depth_sensor:
        return self._depth

    def first_color_sensor(self) -> sensor:
        return self._color

    def hardware_reset(self) -> None:
        """Resets all options to their defaults."""
        self.camera.close()
        self.__init__(SimulatedCamera(self.camera.world))  # type: ignore[misc]  # the object stays the script's


class device_list(list[device]):
    def size(self) -> int:
        return len(self)


class context:
    """A host with one simulated camera."""

    def __init__(self) -> None:
        self.devices = device_list([device()])

    def query_devices(self) -> device_list:
        return self.devices

    def __iter__(self) -> Iterator[device]:
        return iter(self.query_devices())


class rs400_advanced_mode:
    """A device's settings as JSON, and as groups of controls: get_depth_table(mode) and set_depth_table(group), and so
    on for each of options.controls()."""

    def __init__(self, of: device) -> None:
        self._device = of

    def is_enabled(self) -> bool:
        return True

    def toggle_advanced_mode(self, enable: bool) -> None:
        """Ignored: advanced mode is always on."""

    def load_json(self, text: str) -> None:
        """Raises RuntimeError, as librealsense does, if a key is unknown or out of range."""
        self._set(lambda: parse_settings(json.loads(text), "the settings"))

    def __getattr__(self, name: str) -> Any:
        what, _, group = name.partition("_")
        if what not in ("get", "set") or group not in controls():
            raise AttributeError(f"'rs400_advanced_mode' object has no attribute '{name}'")
        if what == "get":
            return lambda mode=0: group_of(self._device.camera.settings, group, mode)
        return lambda numbers: self._set(lambda: with_group(self._device.camera.settings, group, numbers))

    def _set(self, make: Callable[[], AdvancedSettings]) -> None:
        try:
            self._device.camera.set_settings(make())
        except ValueError as error:
            raise RuntimeError(str(error)) from error

    def serialize_json(self) -> str:
        """Every key of the matcher and the depth table, as librealsense writes them, and the others that were given."""
        return json.dumps(self._device.camera.settings.as_text(), indent=4)


_FORMATS = {
    stream.depth: (format.z16,),
    stream.infrared: (format.y8,),
    stream.color: (format.rgb8, format.bgr8, format.rgba8, format.bgra8, format.y8),
}
_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601
# Streams of a pipeline that is started without a config.
_DEFAULT = (StreamRequest(stream.depth), StreamRequest(stream.color))


class config:
    """The streams that a pipeline starts."""

    def __init__(self) -> None:
        self.requests: dict[tuple[stream, int], StreamRequest] = {}

    def enable_stream(self, stream_type: stream, *args: Any, **names: Any) -> None:
        """Any of librealsense's forms: [index,] [width, height,] [format,] [framerate]. Raises RuntimeError for a
        stream or a format that is not simulated."""
        forms = [a for a in args if isinstance(a, format)]
        before = [int(a) for a in (args[: args.index(forms[0])] if forms else args)]
        after = [int(a) for a in args[args.index(forms[0]) + 1 :]] if forms else []
        index = names.get("stream_index", before.pop(0) if len(before) in (1, 3) else 0)
        width, height = (names.get("width", 0), names.get("height", 0)) if len(before) < 2 else before[:2]
        fps = names.get("framerate", before[2] if len(before) > 2 else after[0] if after else 0)
        form = names.get("format", forms[0] if forms else format.any)
        known = _FORMATS.get(stream_type, ())
        if form != format.any and form not in known:
            raise RuntimeError(
                f"Couldn't resolve requests: {stream_type} in {form} is not simulated; there are "
                + "; ".join(f"{s.name}: {', '.join(f.name for f in fs)}" for s, fs in _FORMATS.items())
            )
        if not known:
            raise RuntimeError(f"Couldn't resolve requests: {stream_type} is not simulated")
        if stream_type == stream.infrared and index == 0:
            index = 1
        self.requests[stream_type, index] = StreamRequest(stream_type, index, width, height, form, fps)

    def enable_all_streams(self) -> None:
        for stream_type, index in ((stream.depth, 0), (stream.color, 0), (stream.infrared, 1), (stream.infrared, 2)):
            self.requests[stream_type, index] = StreamRequest(stream_type, index)

    def disable_all_streams(self) -> None:
        self.requests.clear()

    def enable_device(self, serial: str) -> None:
        """Ignored: there is one camera, with any serial number."""

    def enable_device_from_file(self, file_name: str, repeat_playback: bool = True) -> None:
        raise RuntimeError(f"{file_name}: a simulated camera plays no recordings: 'activestereo import' reads them")

    def enable_record_to_file(self, file_name: str) -> None:
        raise RuntimeError(f"{file_name}: record with write_topics()")

    def resolve(self, p: pipeline_wrapper) -> pipeline_profile:
        return pipeline_profile(p.pipeline.device(), self)


class pipeline_profile:
    """The streams of a pipeline, and its device."""

    def __init__(self, of: device, asked: config) -> None:
        self._device = of
        requests = list(asked.requests.values()) or list(_DEFAULT)
        _set_sizes(of.camera, requests)
        self._streams = [_profile(of.camera, request) for request in requests]

    def get_device(self) -> device:
        return self._device

    def get_streams(self) -> list[video_stream_profile]:
        return list(self._streams)

    def get_stream(self, stream_type: stream, stream_index: int = -1) -> video_stream_profile:
        for profile in self._streams:
            if profile.stream_type() == stream_type and stream_index in (-1, profile.stream_index()):
                return profile
        raise RuntimeError(f"Profile does not contain the requested stream {stream_type.name}")


def _set_sizes(camera: SimulatedCamera, requests: list[StreamRequest]) -> None:
    """Raises RuntimeError if streams that are one image here are asked for in two sizes."""
    for streams, name in (((stream.depth, stream.infrared), "depth_size"), ((stream.color,), "color_size")):
        sizes = {(r.width, r.height) for r in requests if r.stream in streams and r.width and r.height}
        if len(sizes) > 1:
            raise RuntimeError(f"Couldn't resolve requests: depth and infrared have one size, not {sorted(sizes)}")
        for size in sizes:
            setattr(camera, name, size)
    camera.set_settings(camera.settings)


def _profile(camera: SimulatedCamera, request: StreamRequest) -> video_stream_profile:
    lens = camera.color() if request.stream == stream.color else camera.infrared()
    form = _FORMATS[request.stream][0] if request.format == format.any else request.format
    fps = request.fps or _FPS
    whole = StreamRequest(request.stream, request.index, lens.width, lens.height, form, fps)
    return video_stream_profile(whole, lens, camera.left_to(request.stream, request.index), camera.baseline_m)


class pipeline_wrapper:
    def __init__(self, of: pipeline) -> None:
        self.pipeline = of


class pipeline:
    """One simulated camera's framesets. Time follows the pictures: each comes 1 / framerate after the last, for any
    duration of its simulation."""

    def __init__(self, ctx: context | None = None) -> None:
        self._device: device | None = None
        self._profile: pipeline_profile | None = None
        self._number = 0
        self._random = np.random.default_rng(0)
        self._queue: Any = None

    def device(self) -> device:
        if self._device is None:
            self._device = device()
        return self._device

    def start(self, *args: Any) -> pipeline_profile:
        """With a config or without; a frame_queue takes the framesets as they come."""
        if self._profile is not None:
            raise RuntimeError("start() cannot be called before stop()")
        asked = next((a for a in args if isinstance(a, config)), config())
        self._queue = next((a for a in args if hasattr(a, "connect")), None)
        of = self.device()
        self._profile, self._number = pipeline_profile(of, asked), 0
        self._random = np.random.default_rng(of.camera.world.seed)
        if self._queue is not None:
            self._queue.connect(self)
        return self._profile

    def stop(self) -> None:
        if self._profile is None:
            raise RuntimeError("stop() cannot be called before start()")
        self._profile = None
        self.device().camera.close()

    def get_active_profile(self) -> pipeline_profile:
        if self._profile is None:
            raise RuntimeError("get_active_profile() cannot be called before start()")
        return self._profile

    def wait_for_frames(self, timeout_ms: int = 5000) -> composite_frame:
        """The next frameset with every stream. A picture takes as long as the simulation needs; timeout_ms matters only
        after the world's last frame."""
        arrived, frames = self.try_wait_for_frames(timeout_ms)
        if not arrived or frames is None:
            raise RuntimeError(f"Frame didn't arrive within {timeout_ms}")
        return frames

    def try_wait_for_frames(self, timeout_ms: int = 5000) -> tuple[bool, composite_frame | None]:
        world = self.device().camera.world
        streams = self.get_active_profile().get_streams()
        while world.frames is None or self._number < world.frames:
            dropped = self._random.random(len(streams)) < world.drop_share
            self._number += 1
            if not dropped.any():
                camera, time_ms = self.device().camera, 1e3 * (self._number - 1) / min(s.fps() for s in streams)
                camera.take_picture(1e-3 * time_ms, any(s.stream_type() == stream.color for s in streams))
                return True, composite_frame([self._frame(camera, profile, time_ms) for profile in streams])
        return False, None

    def poll_for_frames(self) -> composite_frame | None:
        return self.try_wait_for_frames()[1]

    def _frame(self, camera: SimulatedCamera, profile: video_stream_profile, time_ms: float) -> frame:
        pixels, kind = _pixels(camera, profile), profile.stream_type()
        made = depth_frame if kind == stream.depth else video_frame
        world = camera.world
        late_ms = world.latency_ms.get(kind, 0.0)
        if world.jitter_ms:
            late_ms = max(late_ms + world.jitter_ms * self._random.standard_normal(), 0.0)
        metadata = _metadata(camera, profile, self._number, time_ms, late_ms)
        return made(pixels, profile, self._number, time_ms, metadata, camera.unit_m)


def _pixels(camera: SimulatedCamera, profile: video_stream_profile) -> NDArray[Any]:
    if profile.stream_type() == stream.depth:
        return camera.depth()
    if profile.stream_type() == stream.infrared:
        return camera.infrared_pair()[profile.stream_index() - 1]
    rgb, form = camera.rgb(), profile.format()
    if form == format.y8:
        return np.rint(rgb @ _LUMA).astype(np.uint8)
    if form in (format.bgr8, format.bgra8):
        rgb = rgb[..., ::-1]
    if form in (format.rgba8, format.bgra8):
        rgb = np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])
    return np.ascontiguousarray(rgb)


def _metadata(
    camera: SimulatedCamera, profile: video_stream_profile, number: int, time_ms: float, late_ms: float
) -> dict[frame_metadata_value, int]:
    out = {
        frame_metadata_value.frame_counter: number,
        frame_metadata_value.frame_timestamp: round(1e3 * time_ms),
        frame_metadata_value.sensor_timestamp: round(1e3 * time_ms),
        frame_metadata_value.time_of_arrival: round(time_ms + late_ms),
        frame_metadata_value.actual_fps: profile.fps(),
    }
    if profile.stream_type() != stream.color:
        out |= {
            frame_metadata_value.actual_exposure: camera.exposure_us(),
            frame_metadata_value.gain_level: camera.gain_steps(),
            frame_metadata_value.frame_laser_power: round(camera.config().laser_power_mw),
            frame_metadata_value.frame_laser_power_mode: int(camera.is_lit()),
            frame_metadata_value.auto_exposure: int(camera.values[option.enable_auto_exposure]),
        }
    return out


class frame_queue:
    """The newest frames of a pipeline that was started with it."""

    def __init__(self, capacity: int = 1, keep_frames: bool = False) -> None:
        self._capacity = capacity
        self._source: Any = None

    def connect(self, source: Any) -> None:
        self._source = source

    def wait_for_frame(self, timeout_ms: int = 5000) -> composite_frame:
        if self._source is None:
            raise RuntimeError(f"Frame did not arrive in time! (queue without a pipeline, {timeout_ms} ms)")
        return self._source.wait_for_frames(timeout_ms)
