# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's software device, which makes frames from a user's NumPy arrays for align, filters and point clouds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.integrations.realsense.enums import format, option, stream, timestamp_domain
from activestereo.integrations.realsense.frames import (
    StreamRequest,
    depth_frame,
    frame_queue,
    getter,
    syncer,
    video_frame,
    video_stream_profile,
)
from activestereo.integrations.realsense.frames import intrinsics as Intrinsics
from activestereo.integrations.realsense.options import Options

_KINDS: dict[format, tuple[type, int]] = {
    format.z16: (np.uint16, 1), format.y8: (np.uint8, 1), format.y16: (np.uint16, 1), format.rgb8: (np.uint8, 3),
    format.bgr8: (np.uint8, 3), format.rgba8: (np.uint8, 4), format.bgra8: (np.uint8, 4),
}  # fmt: skip


@dataclass
class video_stream:
    """Describes a stream to add to a sensor. bpp: bytes per pixel."""

    type: stream = stream.any
    index: int = 0
    uid: int = 0
    width: int = 0
    height: int = 0
    fps: int = 0
    bpp: int = 0
    fmt: format = format.any
    intrinsics: Intrinsics = field(default_factory=Intrinsics)


@dataclass
class software_video_frame:
    """An image to send as a frame. pixels: an array of the stream's shape and type, or the same bytes in another shape.
    stride: bytes per row, 0 for rows without padding. timestamp: milliseconds."""

    pixels: Any = None
    stride: int = 0
    bpp: int = 0
    timestamp: float = 0.0
    domain: timestamp_domain = timestamp_domain.hardware_clock
    frame_number: int = 0
    profile: video_stream_profile | None = None
    depth_units: float = 0.0


class software_sensor(Options):
    """A sensor whose frames the user supplies."""

    def __init__(self, name: str) -> None:
        super().__init__({})
        self.name = name
        self.profiles: list[video_stream_profile] = []
        self._open: list[video_stream_profile] = []
        self._target: Any = None

    def add_video_stream(self, stream_of: video_stream, is_default: bool = False) -> video_stream_profile:
        """Adds a stream and returns its profile. Raises RuntimeError for a format that is not simulated."""
        if stream_of.fmt not in _KINDS:
            known = ", ".join(form.name for form in _KINDS)
            raise RuntimeError(f"a video stream has one of the formats {known}: {stream_of}")
        v = stream_of
        request = StreamRequest(v.type, v.index, v.width, v.height, v.fmt, v.fps)
        baseline_mm = self._values.get(option.stereo_baseline)
        baseline_m = None if baseline_mm is None else 1e-3 * baseline_mm
        lens = v.intrinsics if v.intrinsics.width else replace(v.intrinsics, width=v.width, height=v.height)
        self.profiles.append(video_stream_profile(request, lens, baseline_m=baseline_m))
        return self.profiles[-1]

    def add_read_only_option(self, which: option, value: float) -> None:
        self._read_only[which] = self._values[which] = float(value)
        if which == option.stereo_baseline:
            for profile in self.profiles:
                profile.baseline_m = 1e-3 * float(value)

    def open(self, profiles: video_stream_profile | list[video_stream_profile]) -> None:
        self._open = profiles if isinstance(profiles, list) else [profiles]

    def start(self, target: Any) -> None:
        """Sends frames to `target` from now on: a syncer, a frame_queue, or a function that takes a frame."""
        self._target = target
        if isinstance(target, syncer):
            target.streams |= {profile.unique_id() for profile in self._open}

    get_stream_profiles = getter("profiles")

    def stop(self) -> None:
        self._target = None

    def close(self) -> None:
        self._open = []

    def on_video_frame(self, given: software_video_frame) -> None:
        """Sends an image to the target as a frame. Raises RuntimeError, with the sizes, if its bytes do not fit the
        stream."""
        if given.profile is None or self._target is None:
            raise RuntimeError("a software frame needs a profile, and its sensor open() and start() before")
        profile = given.profile
        dtype, channels = _KINDS[profile.format()]
        width, height = profile.width(), profile.height()
        row = width * channels * np.dtype(dtype).itemsize
        content = np.ascontiguousarray(given.pixels).reshape(-1).view(np.uint8)
        stride = given.stride or row
        if stride < row or content.size != stride * height:
            raise RuntimeError(
                f"the pixels have {content.size} bytes and the stride {stride}, expected {row * height} bytes of "
                f"{width}x{height} {profile.format().name}"
            )
        pixels: NDArray[Any] = content.reshape(height, stride)[:, :row].copy().view(dtype)
        pixels = pixels if channels == 1 else pixels.reshape(height, width, channels)
        unit_m = given.depth_units or self._values.get(option.depth_units, 0.001)
        kind = depth_frame if profile.stream_type() == stream.depth else video_frame
        made = kind(pixels, profile, given.frame_number, given.timestamp, None, unit_m)
        self._target.put(made) if isinstance(self._target, frame_queue) else self._target(made)


@dataclass
class software_device:
    """A device whose sensors the user adds."""

    sensors: list[software_sensor] = field(default_factory=list)

    def add_sensor(self, name: str) -> software_sensor:
        self.sensors.append(software_sensor(name))
        return self.sensors[-1]

    query_sensors = getter("sensors")
