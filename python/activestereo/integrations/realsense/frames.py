# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's intrinsics, extrinsics and functions on points (metres; x right, y down, z forward); its frames, with
their stream profiles. get_data() returns a NumPy array, which scripts' np.asanyarray() takes without a copy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.lens import distort, undistort
from activestereo.integrations.realsense.enums import distortion, format, frame_metadata_value, stream
from activestereo.integrations.realsense.enums import format as pixel_format


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

    @classmethod
    def from_matrix(cls, size: tuple[int, int], K: NDArray[np.float64], lens: Sequence[float]) -> intrinsics:
        """From an image's (width, height), its 3x3 K and Brown and Conrady's five numbers."""
        model = distortion.brown_conrady
        return cls(*size, K[0, 2], K[1, 2], K[0, 0], K[1, 1], model, [float(c) for c in lens[:5]])

    def divided(self, factor: int) -> intrinsics:
        """The intrinsics of an image reduced by this factor."""
        return intrinsics(
            self.width // factor, self.height // factor, self.ppx / factor, self.ppy / factor,
            self.fx / factor, self.fy / factor, self.model, list(self.coeffs),
        )  # fmt: skip


@dataclass
class extrinsics:
    """rotation: 9 numbers, column after column; translation: metres."""

    rotation: list[float] = field(default_factory=lambda: np.eye(3).ravel().tolist())
    translation: list[float] = field(default_factory=lambda: [0.0] * 3)

    @classmethod
    def from_transform(cls, a_to_b: NDArray[np.float64]) -> extrinsics:
        return cls(a_to_b[:3, :3].T.ravel().tolist(), a_to_b[:3, 3].tolist())

    def matrix(self) -> NDArray[np.float64]:
        """4x4."""
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = np.reshape(self.rotation, (3, 3)).T, self.translation
        return out


def deprojected(camera: intrinsics, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (x, y) at depth 1 through pixels [2, ...]."""
    x, y = (u - camera.ppx) / camera.fx, (v - camera.ppy) / camera.fy
    if any(camera.coeffs):
        x, y = undistort(x, y, camera.coeffs)
    return np.stack([x, y])


def projected(camera: intrinsics, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels [2, ...] of points [3, ...] with z > 0."""
    x, y = points[0] / points[2], points[1] / points[2]
    if any(camera.coeffs):
        x, y = distort(x, y, camera.coeffs)
    return np.stack([camera.fx * x + camera.ppx, camera.fy * y + camera.ppy])


def rs2_deproject_pixel_to_point(intrin: intrinsics, pixel: Sequence[float], depth: float) -> list[float]:
    x, y = deprojected(intrin, *(np.array(float(c)) for c in pixel))
    return [float(depth * x), float(depth * y), float(depth)]


def rs2_project_point_to_pixel(intrin: intrinsics, point: Sequence[float]) -> list[float]:
    return [float(c) for c in projected(intrin, np.asarray(point, np.float64))]


def rs2_transform_point_to_point(extrin: extrinsics, from_point: Sequence[float]) -> list[float]:
    matrix = extrin.matrix()
    return [float(c) for c in matrix[:3, :3] @ np.asarray(from_point, np.float64) + matrix[:3, 3]]


def rs2_fov(intrin: intrinsics) -> list[float]:
    """Horizontal and vertical field of view, degrees."""
    sides = ((intrin.ppx, intrin.width, intrin.fx), (intrin.ppy, intrin.height, intrin.fy))
    return [float(np.degrees(np.arctan2(c + 0.5, f) + np.arctan2(n - c - 0.5, f))) for c, n, f in sides]


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

    is_default = is_video_stream_profile

    def get_extrinsics_to(self, to: video_stream_profile) -> extrinsics:
        return extrinsics.from_transform(to.left_to_stream @ np.linalg.inv(self.left_to_stream))

    def seen(self, lens: intrinsics, form: pixel_format | None = None) -> video_stream_profile:
        """The same stream through other intrinsics, or in another format."""
        r = self.request
        request = StreamRequest(r.stream, r.index, lens.width, lens.height, r.format if form is None else form, r.fps)
        return video_stream_profile(request, lens, self.left_to_stream, self.baseline_m)

    def __repr__(self) -> str:
        r = self.request
        return f"<video_stream_profile: {self.stream_name()} {r.width}x{r.height} @ {r.fps}fps {r.format.name}>"


stream_profile = video_stream_profile


class frame:
    """An image of a stream. timestamp: milliseconds at the middle of the exposure."""

    def __init__(
        self, pixels: NDArray[Any], profile: video_stream_profile, number: int, timestamp: float,
        metadata: Mapping[frame_metadata_value, int] | None = None, unit_m: float = 0.001,
    ) -> None:  # fmt: skip
        self._pixels, self.profile, self.frame_number, self.timestamp = pixels, profile, number, timestamp
        self.metadata, self.unit_m = dict(metadata or {}), unit_m

    def changed(self, pixels: NDArray[Any], profile: video_stream_profile | None = None) -> frame:
        """A frame of the same moment with other pixels."""
        profile = self.profile if profile is None else profile
        kind = depth_frame if profile.stream_type() == stream.depth else video_frame
        if profile.format() == format.disparity32:
            kind = disparity_frame
        return kind(pixels, profile, self.frame_number, self.timestamp, self.metadata, self.unit_m)

    def get_data(self) -> NDArray[Any]:
        return self._pixels

    data = property(get_data)

    def get_frame_number(self) -> int:
        return self.frame_number

    def get_timestamp(self) -> float:
        return self.timestamp

    def get_profile(self) -> video_stream_profile:
        return self.profile

    def supports_frame_metadata(self, which: frame_metadata_value) -> bool:
        return which in self.metadata

    def get_frame_metadata(self, which: frame_metadata_value) -> int:
        if which not in self.metadata:
            raise RuntimeError(f"metadata not available for {which}")
        return self.metadata[which]

    def keep(self) -> None:
        """Ignored: a frame lives as long as its references."""

    def is_video_frame(self) -> bool:
        return isinstance(self, video_frame)

    def is_depth_frame(self) -> bool:
        return isinstance(self, depth_frame)

    def is_frameset(self) -> bool:
        return False

    def as_frame(self) -> frame:
        return self

    def as_video_frame(self) -> frame:
        return self

    def as_depth_frame(self) -> frame:
        return self

    def __bool__(self) -> bool:
        return True


class video_frame(frame):
    def get_width(self) -> int:
        return int(self._pixels.shape[1])

    def get_height(self) -> int:
        return int(self._pixels.shape[0])

    width = property(get_width)
    height = property(get_height)


class depth_frame(video_frame):
    def get_units(self) -> float:
        """Metres per count."""
        return self.unit_m

    def get_distance(self, x: int, y: int) -> float:
        """Metres, 0 = not measured."""
        if not (0 <= x < self.get_width() and 0 <= y < self.get_height()):
            raise RuntimeError(f"pixel {x}, {y} is outside of {self.get_width()}x{self.get_height()}")
        return float(self._pixels[y, x]) * self.unit_m


class disparity_frame(depth_frame):
    """float32 disparities, 1/32 px."""

    def get_baseline(self) -> float:
        """Millimetres between the infrared cameras."""
        return 1e3 * (self.profile.baseline_m or 0.0)


class composite_frame(frame):
    """Frames of one moment, one of each stream."""

    def __init__(self, frames: Sequence[frame]) -> None:
        first = frames[0]
        super().__init__(first.get_data(), first.profile, first.frame_number, first.timestamp, first.metadata)
        self._frames = list(frames)

    def first_or_default(self, s: stream, f: format = format.any) -> frame | None:
        kinds = ((one, one.profile.stream_type(), one.profile.format()) for one in self._frames)
        return next((one for one, kind, form in kinds if kind == s and f in (format.any, form)), None)

    def first(self, s: stream, f: format = format.any) -> frame:
        found = self.first_or_default(s, f)
        if found is None:
            raise RuntimeError(f"frame of the requested stream {s.name} not found in the frameset")
        return found

    def get_depth_frame(self) -> frame | None:
        return self.first_or_default(stream.depth)

    def get_color_frame(self) -> frame | None:
        return self.first_or_default(stream.color)

    def get_infrared_frame(self, index: int = 0) -> frame | None:
        """The infrared frame of an index; index 0 gives the first one."""
        infrared = (one for one in self._frames if one.profile.stream_type() == stream.infrared)
        return next((one for one in infrared if index in (0, one.profile.stream_index())), None)

    def size(self) -> int:
        return len(self._frames)

    def is_frameset(self) -> bool:
        return True

    def as_frameset(self) -> composite_frame:
        return self

    def __len__(self) -> int:
        return len(self._frames)

    def __iter__(self) -> Iterator[frame]:
        return iter(self._frames)

    def __getitem__(self, index: int) -> frame:
        return self._frames[index]
