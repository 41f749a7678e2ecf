# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's context, devices and sensors of one simulated camera, and its pipeline. Each frameset of the pipeline
is one simulated picture."""

from __future__ import annotations

import json
import os
import weakref
from types import SimpleNamespace
from typing import Any

import numpy as np

from activestereo.camera.advanced_mode.settings import parse_settings
from activestereo.common.computed_once import computed_once
from activestereo.integrations.realsense.camera import SimulatedCamera, World, sensor_ranges
from activestereo.integrations.realsense.frames import (
    StreamRequest,
    composite_frame,
    depth_frame,
    frame,
    frame_queue,
    getter,
    ignored,
    video_frame,
    video_stream_profile,
)
from activestereo.integrations.realsense.options import (
    Described,
    Options,
    camera_info,
    controls,
    format,
    frame_metadata_value,
    option,
    stream,
)

_PRODUCT_IDS = {"D405": "0B5B", "D415": "0AD3", "D435": "0B07", "D435I": "0B3A", "D455": "0B5C"}
_SIZES, _FPS = ((640, 480), (848, 480), (1280, 720)), 30
# The simulated camera, which all contexts, devices and pipelines share as they share a real one.
_cameras: list[SimulatedCamera] = []


def simulate(world: World) -> None:
    """Plugs in a new camera, which sees this world; existing devices keep theirs."""
    _cameras[:] = [SimulatedCamera(world)]


def _shared_camera() -> SimulatedCamera:
    if not _cameras:
        simulate(World(os.environ.get("ACTIVESTEREO_SCENE"), os.environ.get("ACTIVESTEREO_SENSOR", "D435")))
    return _cameras[0]


class sensor(Options, Described):
    """One of a device's sensors. modes: {(stream, index): its formats}."""

    modes: dict[tuple[stream, int], tuple[format, ...]] = {(stream.color, 0): (format.rgb8, format.bgr8)}

    def __init__(self, name: str, camera: SimulatedCamera, *args: Any) -> None:
        super().__init__(*args)
        self.name, self._camera, self.info = name, camera, {camera_info.name: name}

    def get_stream_profiles(self) -> list[video_stream_profile]:
        """Returns profiles of the usual modes; a pipeline also takes any other size."""
        return [
            self._camera.profile(StreamRequest(kind, index, *size, form, _FPS, (size, form) == (_SIZES[0], forms[0])))
            for (kind, index), forms in self.modes.items()
            for size in _SIZES
            for form in forms
        ]


class depth_sensor(sensor):
    modes = {(stream.depth, 0): (format.z16,), (stream.infrared, 1): (format.y8,), (stream.infrared, 2): (format.y8,)}

    def __init__(self, camera: SimulatedCamera) -> None:
        ranges = sensor_ranges(camera.base)
        baseline_mm = 1e3 * camera.baseline_m
        super().__init__("Stereo Module", camera, ranges, {option.stereo_baseline: baseline_mm}, camera.set_option)
        camera.values = self._values | camera.values
        self._values = camera.values  # which a preset or advanced settings change, too

    def get_depth_scale(self) -> float:
        """Returns metres per count of depth."""
        return self._camera.values[option.depth_units]


class device(Described):
    def __init__(self, camera: SimulatedCamera | None = None) -> None:
        camera = camera or _shared_camera()
        self.camera, self._depth, self._color = camera, depth_sensor(camera), sensor("RGB Camera", camera, {})
        self.sensors: list[sensor] = [self._depth, self._color]
        model = self.camera.base.model.upper().removeprefix("SAPIEN-")
        self.info = {
            camera_info.name: f"Intel RealSense {model} (simulated)",
            camera_info.serial_number: camera.world.serial_number,
            camera_info.firmware_version: "5.16.0.1",
            camera_info.physical_port: "simulated",
            camera_info.advanced_mode: "YES",
            camera_info.product_id: _PRODUCT_IDS.get(model, "0B07"),
            camera_info.usb_type_descriptor: "3.2",
            camera_info.product_line: "D400",
        }

    def supports(self, which: int) -> bool:
        return which in self.info

    query_sensors, first_depth_sensor, first_color_sensor = getter("sensors"), getter("_depth"), getter("_color")

    def hardware_reset(self) -> None:
        """Resets all options to their defaults; the script's object stays the same."""
        self.camera.close()
        new = SimulatedCamera(self.camera.world)
        _cameras[:] = [new if camera is self.camera else camera for camera in _cameras]
        self.__init__(new)  # type: ignore[misc]  # the object stays the script's


class device_list(list[device]):
    size = list.__len__


class context:
    """pyrealsense2's context of a host with one simulated camera."""

    def __init__(self) -> None:
        self.devices = device_list([device()])

    query_devices = getter("devices")


class rs400_advanced_mode:
    """Reads and sets a device's advanced settings, as JSON or by group: get_depth_table(mode), set_depth_table(group)
    and likewise for each group of options.controls()."""

    def __init__(self, of: device) -> None:
        self._device = of  # whose hardware_reset() makes another camera

    def is_enabled(self) -> bool:
        return True

    toggle_advanced_mode = ignored  # it is always on

    def load_json(self, text: str) -> None:
        """Sets the settings in a JSON text. Raises RuntimeError, as librealsense does, if a key is unknown or out of
        range."""
        try:
            self._device.camera.set_settings(parse_settings(json.loads(text), "the settings"))
        except ValueError as error:
            raise RuntimeError(str(error)) from error

    def serialize_json(self) -> str:
        """Returns as JSON every key of the matcher and the depth table, as librealsense writes them, and the other keys
        that were set."""
        return json.dumps(self._device.camera.settings.as_text(), indent=4)

    def __getattr__(self, name: str) -> Any:
        verb, _, group = name.partition("_")
        if verb not in ("get", "set") or group not in controls():
            raise AttributeError(f"'rs400_advanced_mode' object has no attribute '{name}'")
        fields, camera = controls()[group], self._device.camera

        def get_numbers(mode: int = 0) -> SimpleNamespace:
            """Returns the group's values; mode 1 and 2 give their minima and maxima, as in librealsense."""
            found = {}
            for name, key in fields.items():
                values = (camera.settings.number(key.name),) if mode == 0 else key.range
                numbers = sorted(round(key.control_offset + key.control_scale * value, 6) for value in values)
                found[name] = numbers[max(mode - 1, 0)]
            return SimpleNamespace(**found)

        def set_numbers(numbers: SimpleNamespace) -> None:
            """Sets the group's changed values; those equal to the present settings stay as they are."""
            changed = {}
            for name, key in fields.items():
                value = (float(getattr(numbers, name)) - key.control_offset) / key.control_scale + 0.0  # no -0
                if abs(value - camera.settings.number(key.name)) > 1e-6:
                    changed[key.name] = value
            if changed:
                try:
                    camera.set_settings(parse_settings({**camera.settings.values, **changed}, group))
                except ValueError as error:
                    raise RuntimeError(str(error)) from error

        return get_numbers if verb == "get" else set_numbers


_FORMATS = {
    stream.depth: (format.z16,),
    stream.infrared: (format.y8,),
    stream.color: (format.rgb8, format.bgr8, format.rgba8, format.bgra8, format.y8),
}
# Streams of a pipeline that is started without a config.
_DEFAULT = (StreamRequest(stream.depth), StreamRequest(stream.color))


class config:
    """Collects the streams that a pipeline is to start."""

    def __init__(self) -> None:
        self.requests: dict[tuple[stream, int], StreamRequest] = {}
        self.serial: str | None = None

    def enable_stream(self, stream_type: stream, *args: Any, **names: Any) -> None:
        """Requests a stream. Takes any of librealsense's argument lists: [index,] [width, height,] [format,]
        [framerate]. Raises RuntimeError for a stream or a format that is not simulated."""
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
        if fps < 0:
            raise RuntimeError(f"Couldn't resolve requests: {fps} frames a second")
        if bool(width) != bool(height):
            raise RuntimeError(f"Couldn't resolve requests: a size of {width}x{height}: give both sides, or none")
        there = (1, 2) if stream_type == stream.infrared else (0,)
        index = there[0] if index in (-1, 0) else index
        if index not in there:
            text = f"{stream_type.name} has the index {' or '.join(map(str, there))}, not {index}"
            raise RuntimeError(f"Couldn't resolve requests: {text}")
        self.requests[stream_type, index] = StreamRequest(stream_type, index, width, height, form, fps)

    def enable_all_streams(self) -> None:
        for stream_type, index in ((stream.depth, 0), (stream.color, 0), (stream.infrared, 1), (stream.infrared, 2)):
            self.requests[stream_type, index] = StreamRequest(stream_type, index)

    def disable_all_streams(self) -> None:
        self.requests.clear()

    def enable_device(self, serial: str) -> None:
        """Requests the camera with this serial number; start() and resolve() raise RuntimeError for another one."""
        self.serial = serial

    def enable_device_from_file(self, file_name: str, repeat_playback: bool = True) -> None:
        raise RuntimeError(f"{file_name}: a simulated camera plays no recordings: 'activestereo import' reads them")

    def enable_record_to_file(self, file_name: str) -> None:
        raise RuntimeError(f"{file_name}: record with write_topics()")

    def resolve(self, p: pipeline) -> pipeline_profile:
        return pipeline_profile(p.device(), self)


class pipeline_profile:
    """Resolves the requested streams of a pipeline on its device. Raises RuntimeError if depth and infrared, which
    share one image size, are requested in two sizes, and for another device's serial number."""

    def __init__(self, of: device, asked: config) -> None:
        self.device = of
        own = of.info[camera_info.serial_number]
        if asked.serial not in (None, own):
            remedy = f"World(serial_number='{asked.serial}') gives it this number"
            raise RuntimeError(f"No device connected with '{asked.serial}': the simulated camera has '{own}'; {remedy}")
        requests = list(asked.requests.values()) or list(_DEFAULT)
        for streams, name in (((stream.depth, stream.infrared), "depth_size"), ((stream.color,), "color_size")):
            sizes = {(r.width, r.height) for r in requests if r.stream in streams and r.width and r.height}
            if len(sizes) > 1:
                raise RuntimeError(f"Couldn't resolve requests: depth and infrared have one size, not {sorted(sizes)}")
            setattr(of.camera, name, sizes.pop() if sizes else getattr(of.camera, f"own_{name}"))
        of.camera.set_settings(of.camera.settings)
        self.streams: list[video_stream_profile] = []
        for r in requests:
            form = _FORMATS[r.stream][0] if r.format == format.any else r.format
            # The size is left to the camera, so that streams of one image have one size even if requested without it.
            self.streams.append(of.camera.profile(StreamRequest(r.stream, r.index, 0, 0, form, r.fps or _FPS)))

    get_device, get_streams = getter("device"), getter("streams")

    def get_stream(self, stream_type: stream, stream_index: int = -1) -> video_stream_profile:
        for profile in self.streams:
            if profile.stream_type() == stream_type and stream_index in (-1, profile.stream_index()):
                return profile
        raise RuntimeError(f"Profile does not contain the requested stream {stream_type.name}")


def pipeline_wrapper(of: pipeline) -> pipeline:
    """Returns the pipeline itself; scripts wrap a pipeline for config.resolve()."""
    return of


class pipeline:
    """Delivers one simulated camera's framesets. Simulated time advances by 1 / framerate with each picture, however
    long its computation takes."""

    def __init__(self, ctx: context | None = None) -> None:
        self._profile: pipeline_profile | None = None
        self._number = 0
        self._random = np.random.default_rng(0)

    @computed_once
    def device(self) -> device:
        return device()

    def start(self, *args: Any) -> pipeline_profile:
        """Starts the streams of a config, or depth and colour without one, and returns their profile. A frame_queue, if
        given, delivers the framesets. Raises RuntimeError for anything else: no callback is called."""
        if self._profile is not None:
            raise RuntimeError("start() cannot be called before stop()")
        for given in args:
            if not isinstance(given, (config, frame_queue)):
                kind = type(given).__name__
                raise RuntimeError(
                    f"start() takes a config and a frame_queue, not a {kind}: ask with wait_for_frames()"
                )
        asked = next((a for a in args if isinstance(a, config)), config())
        queue = next((a for a in args if isinstance(a, frame_queue)), None)
        of = self.device()
        other = of.camera.streams_to()
        if other is not None and other is not self:
            raise RuntimeError("Device or resource busy: another pipeline has the camera: call its stop() first")
        self._profile, self._number = pipeline_profile(of, asked), 0
        of.camera.streams_to = weakref.ref(self)
        self._random = np.random.default_rng(of.camera.world.seed)
        if queue is not None:
            queue.source = self
        return self._profile

    def stop(self) -> None:
        if self._profile is None:
            raise RuntimeError("stop() cannot be called before start()")
        self._profile = None
        self.device().camera.streams_to = lambda: None
        self.device().camera.close()

    def get_active_profile(self) -> pipeline_profile:
        if self._profile is None:
            raise RuntimeError("get_active_profile() cannot be called before start()")
        return self._profile

    def wait_for_frames(self, timeout_ms: int = 5000) -> composite_frame:
        """Returns the next frameset with every stream. It takes as long as the simulation needs; timeout_ms matters
        only for the RuntimeError after the world's last frame."""
        arrived, frames = self.try_wait_for_frames(timeout_ms)
        if not arrived or frames is None:
            raise RuntimeError(f"Frame didn't arrive within {timeout_ms}")
        return frames

    def try_wait_for_frames(self, timeout_ms: int = 5000) -> tuple[bool, composite_frame | None]:
        camera, streams = self.device().camera, self.get_active_profile().get_streams()
        world = camera.world
        while world.frames is None or self._number < world.frames:
            dropped = self._random.random(len(streams)) < world.drop_share
            self._number += 1
            if not dropped.any():
                time_ms = 1e3 * (self._number - 1) / min(s.fps() for s in streams)
                camera.take_picture(1e-3 * time_ms, any(s.stream_type() == stream.color for s in streams))
                return True, composite_frame([self._frame(profile, time_ms) for profile in streams])
        return False, None

    def poll_for_frames(self) -> composite_frame | None:
        return self.try_wait_for_frames()[1]

    def _frame(self, profile: video_stream_profile, time_ms: float) -> frame:
        camera, kind = self.device().camera, profile.stream_type()
        late_ms = camera.world.latency_ms.get(kind, 0.0)
        if camera.world.jitter_ms:
            late_ms = max(late_ms + camera.world.jitter_ms * self._random.standard_normal(), 0.0)
        metadata = {
            frame_metadata_value.frame_counter: self._number,
            frame_metadata_value.frame_timestamp: round(1e3 * time_ms),
            frame_metadata_value.sensor_timestamp: round(1e3 * time_ms),
            frame_metadata_value.time_of_arrival: round(time_ms + late_ms),
            frame_metadata_value.actual_fps: profile.fps(),
        }
        if kind != stream.color:
            metadata |= camera.light()
        made, unit_m = depth_frame if kind == stream.depth else video_frame, camera.values[option.depth_units]
        return made(camera.pixels(profile), profile, self._number, time_ms, metadata, unit_m)
