# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's frames with their stream profiles, intrinsics, extrinsics and functions on points (metres; x right, y
down, z forward). get_data() returns a NumPy array, which scripts' np.asanyarray() takes without a copy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.lens import to_pixels, to_tangents
from activestereo.common.pose import rigid_motion
from activestereo.integrations.realsense.options import distortion, frame_metadata_value, stream
from activestereo.integrations.realsense.options import format as pixel_format


@dataclass
class intrinsics:
    width: int = 0
    height: int = 0
    ppx: float = 0.0
    ppy: float = 0.0
    fx: float = 0.0
    fy: float = 0.0
    model: distortion = distortion.none
    coeffs: list[float] = field(default_factory=lambda: [0.0] * 5)

    def matrix(self) -> NDArray[np.float64]:
        return np.array([[self.fx, 0.0, self.ppx], [0.0, self.fy, self.ppy], [0.0, 0.0, 1.0]])


@dataclass
class extrinsics:
    """A transform between streams. rotation: 9 numbers, column after column; translation: metres."""

    rotation: list[float] = field(default_factory=lambda: np.eye(3).ravel().tolist())
    translation: list[float] = field(default_factory=lambda: [0.0] * 3)

    def matrix(self) -> NDArray[np.float64]:
        """Returns the transform as 4x4."""
        return rigid_motion(self.translation, np.reshape(self.rotation, (3, 3)).T)


def deprojected(camera: intrinsics, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns x and y at depth 1 of the rays through pixels (u, v), [2, ...]."""
    return np.stack(to_tangents(u, v, camera.matrix(), camera.coeffs))


def projected(camera: intrinsics, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the pixels [2, ...] of points [3, ...] with z > 0, through the lens."""
    return np.stack(to_pixels(points[0] / points[2], points[1] / points[2], camera.matrix(), camera.coeffs))


def rs2_deproject_pixel_to_point(intrin: intrinsics, pixel: Sequence[float], depth: float) -> list[float]:
    x, y = deprojected(intrin, *(np.array(float(c)) for c in pixel))
    return [float(depth * x), float(depth * y), float(depth)]


def rs2_project_point_to_pixel(intrin: intrinsics, point: Sequence[float]) -> list[float]:
    return [float(c) for c in projected(intrin, np.asarray(point, np.float64))]


def rs2_transform_point_to_point(extrin: extrinsics, from_point: Sequence[float]) -> list[float]:
    matrix = extrin.matrix()
    return [float(c) for c in matrix[:3, :3] @ np.asarray(from_point, np.float64) + matrix[:3, 3]]


_NAMES = {stream.depth: "Depth", stream.color: "Color", stream.infrared: "Infrared"}


def getter(path: str) -> Any:
    """Returns a method without arguments that returns an attribute of its object, because pyrealsense2 has methods
    there. path: the attribute, such as 'request.fps'."""
    read = attrgetter(path)
    return lambda self: read(self)


def ignored(self: Any, *values: Any, **named: Any) -> None:
    """Does nothing; stands in for methods that have no effect on a simulated camera."""


@dataclass(frozen=True)
class StreamRequest:
    """The stream that a pyrealsense2 config asks for: kind, index, size in pixels, format, rate in 1/s, and whether it
    is the stream's default. 0 and format.any accept any value."""

    stream: stream
    index: int = 0
    width: int = 0
    height: int = 0
    format: pixel_format = pixel_format.any
    fps: int = 0
    is_default: bool = False


class video_stream_profile:
    """Describes one stream. left_to_stream: 4x4, from the axes of the left infrared camera, which are depth's, to the
    stream's. baseline_m: distance of the infrared cameras; None if unknown."""

    def __init__(
        self, request: StreamRequest | video_stream_profile, lens: intrinsics | None = None,
        left_to_stream: NDArray[np.float64] | None = None, baseline_m: float | None = None,
    ) -> None:  # fmt: skip
        if isinstance(request, video_stream_profile):  # rs.video_stream_profile(profile), as scripts cast
            given: video_stream_profile = request
            request, lens, left_to_stream, baseline_m = (
                given.request, given.intrinsics, given.left_to_stream, given.baseline_m,
            )  # fmt: skip
        if lens is None:
            raise TypeError("a stream profile needs intrinsics")
        self.request: StreamRequest = request
        self.intrinsics: intrinsics = lens
        self.left_to_stream: NDArray[np.float64] = np.eye(4) if left_to_stream is None else left_to_stream
        self.baseline_m: float | None = baseline_m

    stream_type, stream_index = getter("request.stream"), getter("request.index")
    format, fps, is_default = getter("request.format"), getter("request.fps"), getter("request.is_default")
    width, height, get_intrinsics = getter("intrinsics.width"), getter("intrinsics.height"), getter("intrinsics")

    def stream_name(self) -> str:
        return _NAMES[self.request.stream] + (f" {self.request.index}" if self.request.index else "")

    def unique_id(self) -> int:
        return 10 * self.request.stream + self.request.index

    def as_video_stream_profile(self) -> video_stream_profile:
        return self

    def is_video_stream_profile(self) -> bool:
        return True

    def get_extrinsics_to(self, to: video_stream_profile) -> extrinsics:
        transform = to.left_to_stream @ np.linalg.inv(self.left_to_stream)
        return extrinsics(transform[:3, :3].T.ravel().tolist(), transform[:3, 3].tolist())

    def seen(self, lens: intrinsics, form: pixel_format | None = None) -> video_stream_profile:
        """Returns a copy of this profile for images with the size and intrinsics `lens`, and of pixel format `form`;
        None: unchanged."""
        form = self.request.format if form is None else form
        request = replace(self.request, width=lens.width, height=lens.height, format=form)
        return video_stream_profile(request, lens, self.left_to_stream, self.baseline_m)


stream_profile = video_stream_profile


class frame:
    """An image of a stream. timestamp: milliseconds at the middle of the exposure. unit_m: metres per count of
    depth."""

    def __init__(
        self, pixels: NDArray[Any], profile: video_stream_profile, number: int, timestamp: float,
        metadata: Mapping[frame_metadata_value, int] | None = None, unit_m: float = 0.001,
    ) -> None:  # fmt: skip
        self.data, self.profile, self.frame_number, self.timestamp = pixels, profile, number, timestamp
        self.metadata, self.unit_m = dict(metadata or {}), unit_m

    get_data, get_profile = getter("data"), getter("profile")
    get_frame_number, get_timestamp = getter("frame_number"), getter("timestamp")

    def changed(self, pixels: NDArray[Any], profile: video_stream_profile | None = None) -> frame:
        """Returns a copy of this frame, with its number and time but other pixels. profile: the new stream profile;
        None: unchanged."""
        profile = self.profile if profile is None else profile
        kind = depth_frame if profile.stream_type() == stream.depth else video_frame
        if profile.format() == pixel_format.disparity32:
            kind = disparity_frame
        return kind(pixels, profile, self.frame_number, self.timestamp, self.metadata, self.unit_m)

    def supports_frame_metadata(self, which: frame_metadata_value) -> bool:
        return which in self.metadata

    def get_frame_metadata(self, which: frame_metadata_value) -> int:
        if which not in self.metadata:
            raise RuntimeError(f"metadata not available for {which}")
        return self.metadata[which]

    keep = ignored  # a frame lives as long as its references


class video_frame(frame):
    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self.height, self.width = (int(n) for n in self.data.shape[:2])

    get_width, get_height = getter("width"), getter("height")


class depth_frame(video_frame):
    get_units = getter("unit_m")  # metres per count

    def get_distance(self, x: int, y: int) -> float:
        """Returns the depth at a pixel, metres, 0 = not measured."""
        if not (0 <= x < self.width and 0 <= y < self.height):
            raise RuntimeError(f"pixel {x}, {y} is outside of {self.width}x{self.height}")
        return float(self.data[y, x]) * self.unit_m


class disparity_frame(depth_frame):
    """A frame of float32 disparities in 1/32 px."""

    def get_baseline(self) -> float:
        """Returns the distance between the infrared cameras, millimetres."""
        return 1e3 * (self.profile.baseline_m or 0.0)


class composite_frame(frame):
    """A frameset: frames of one moment, one of each stream."""

    def __init__(self, frames: Sequence[frame]) -> None:
        first = frames[0]
        super().__init__(first.data, first.profile, first.frame_number, first.timestamp, first.metadata)
        self._frames = list(frames)

    def first_or_default(self, s: stream, f: pixel_format = pixel_format.any, index: int = 0) -> frame | None:
        """Returns the stream's first frame, with this format and index if they are given; None if there is none."""
        for one in self._frames:
            r = one.profile.request
            if r.stream == s and f in (pixel_format.any, r.format) and index in (0, r.index):
                return one
        return None

    def first(self, s: stream, f: pixel_format = pixel_format.any) -> frame:
        found = self.first_or_default(s, f)
        if found is None:
            raise RuntimeError(f"frame of the requested stream {s.name} not found in the frameset")
        return found

    def get_depth_frame(self) -> frame | None:
        return self.first_or_default(stream.depth)

    def get_color_frame(self) -> frame | None:
        return self.first_or_default(stream.color)

    def get_infrared_frame(self, index: int = 0) -> frame | None:
        """Returns the infrared frame with this index, or the first one for index 0; None if there is none."""
        return self.first_or_default(stream.infrared, index=index)

    def __len__(self) -> int:
        return len(self._frames)

    size = __len__

    def __iter__(self) -> Iterator[frame]:
        return iter(self._frames)

    def __getitem__(self, index: int) -> frame:
        return self._frames[index]


# Scripts ask frames for their kind, and cast them.
for _name, _kind in {"video_frame": video_frame, "depth_frame": depth_frame, "frameset": composite_frame}.items():
    setattr(frame, f"is_{_name}", lambda self, kind=_kind: isinstance(self, kind))
for _name in ("frame", "video_frame", "depth_frame", "frameset"):
    setattr(frame, f"as_{_name}", lambda self: self)


class frame_queue:
    """Delivers the framesets of the pipeline that was started with it. source: that pipeline."""

    def __init__(self, capacity: int = 1, keep_frames: bool = False) -> None:
        self.source: Any = None

    def wait_for_frame(self, timeout_ms: int = 5000) -> Any:
        """Returns the pipeline's next frameset. Raises RuntimeError at once without a pipeline, since no frame can
        arrive."""
        if self.source is None:
            raise RuntimeError(f"Frame did not arrive in time! (no pipeline sends into this queue; {timeout_ms} ms)")
        return self.source.wait_for_frames(timeout_ms)
