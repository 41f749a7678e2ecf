# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's stream profiles: which image, how large, how often, seen through which lens from where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from activestereo.integrations.realsense.enums import format as pixel_format
from activestereo.integrations.realsense.enums import stream
from activestereo.integrations.realsense.geometry import extrinsics, intrinsics

_NAMES = {stream.depth: "Depth", stream.color: "Color", stream.infrared: "Infrared"}


@dataclass(frozen=True)
class StreamRequest:
    """A stream that a config asks for; 0 and format.any: whatever there is."""

    stream: stream
    index: int = 0
    width: int = 0
    height: int = 0
    format: pixel_format = pixel_format.any
    fps: int = 0


class video_stream_profile:
    """One stream. left_to_stream: 4x4, from the left infrared camera, which depth belongs to. baseline_m: between the
    infrared cameras; None if unknown."""

    def __init__(
        self, request: StreamRequest | video_stream_profile, lens: intrinsics | None = None,
        left_to_stream: NDArray[np.float64] | None = None, baseline_m: float | None = None,
    ) -> None:  # fmt: skip
        if isinstance(request, video_stream_profile):  # rs.video_stream_profile(profile), as scripts cast
            given: video_stream_profile = request
            lens, left_to_stream, request = given.get_intrinsics(), given.left_to_stream, given.request
            baseline_m = given.baseline_m
        if lens is None:
            raise TypeError("a stream profile needs intrinsics")
        self.request: StreamRequest = request
        self.intrinsics: intrinsics = lens
        self.left_to_stream: NDArray[np.float64] = np.eye(4) if left_to_stream is None else left_to_stream
        self.baseline_m: float | None = baseline_m

    def stream_type(self) -> stream:
        return self.request.stream

    def stream_index(self) -> int:
        return self.request.index

    def stream_name(self) -> str:
        name = _NAMES[self.request.stream]
        return f"{name} {self.request.index}" if self.request.index else name

    def format(self) -> pixel_format:
        return self.request.format

    def fps(self) -> int:
        return self.request.fps

    def unique_id(self) -> int:
        return 10 * self.request.stream + self.request.index

    def width(self) -> int:
        return self.intrinsics.width

    def height(self) -> int:
        return self.intrinsics.height

    def get_intrinsics(self) -> intrinsics:
        return self.intrinsics

    def as_video_stream_profile(self) -> video_stream_profile:
        return self

    def is_video_stream_profile(self) -> bool:
        return True

    def is_default(self) -> bool:
        return True

    def get_extrinsics_to(self, to: video_stream_profile) -> extrinsics:
        return extrinsics.from_transform(to.left_to_stream @ np.linalg.inv(self.left_to_stream))

    def register_extrinsics_to(self, to: video_stream_profile, motion: extrinsics) -> None:
        """Sets another stream's pose relative to this one, for streams of a software device."""
        to.left_to_stream = motion.matrix() @ self.left_to_stream

    def seen(self, lens: intrinsics, form: pixel_format | None = None) -> video_stream_profile:
        """The same stream through other intrinsics, or in another format."""
        r = self.request
        request = StreamRequest(r.stream, r.index, lens.width, lens.height, r.format if form is None else form, r.fps)
        return video_stream_profile(request, lens, self.left_to_stream, self.baseline_m)

    def __repr__(self) -> str:
        r = self.request
        return f"<video_stream_profile: {self.stream_name()} {r.width}x{r.height} @ {r.fps}fps {r.format.name}>"


stream_profile = video_stream_profile
