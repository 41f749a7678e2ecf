# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's frames. get_data() returns a NumPy array, which scripts' np.asanyarray() takes without a copy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from activestereo.integrations.realsense.enums import format, frame_metadata_value, stream, timestamp_domain
from activestereo.integrations.realsense.profiles import video_stream_profile


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

    @property
    def data(self) -> NDArray[Any]:
        return self._pixels

    def get_frame_number(self) -> int:
        return self.frame_number

    def get_timestamp(self) -> float:
        return self.timestamp

    def get_frame_timestamp_domain(self) -> timestamp_domain:
        return timestamp_domain.hardware_clock

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

    def is_points(self) -> bool:
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
        return next(
            (
                one
                for one in self._frames
                if one.profile.stream_type() == s and f in (format.any, one.profile.format())
            ),
            None,
        )

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
