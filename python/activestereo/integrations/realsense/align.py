# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's align: every stream seen from one of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from activestereo.integrations.realsense.enums import stream
from activestereo.integrations.realsense.frames import composite_frame, frame
from activestereo.integrations.realsense.geometry import deprojected, intrinsics, projected, rs2_fov
from activestereo.integrations.realsense.profiles import video_stream_profile

_CORNER_PX = 0.5  # a pixel covers the area between its corners
_WIDEST_PX = 15


class align:
    """Frames of a frameset in the image of `to`: depth into colour, or colour into depth."""

    def __init__(self, to: stream) -> None:
        self._to = to

    def process(self, frames: composite_frame) -> composite_frame:
        """Aligns a frameset. Raises RuntimeError if it lacks depth or the target stream."""
        depth, target = frames.first(stream.depth), frames.first(self._to)
        if self._to == stream.depth:
            others = [one for one in frames if one.profile.stream_type() != stream.depth]
            return composite_frame([depth, *(_color_in_depth(one, depth) for one in others)])
        aligned = _depth_in_color(depth, target.profile)
        return composite_frame([aligned if one is depth else one for one in frames])


def _points(depth: frame, corner_px: float = 0.0) -> NDArray[np.float64]:
    """[3, n] points of the measured pixels in the depth camera, metres."""
    counts = np.asarray(depth.get_data())
    v, u = np.nonzero(counts)
    rays = deprojected(depth.profile.intrinsics, u + corner_px, v + corner_px)
    z = depth.unit_m * counts[v, u]
    return np.stack([rays[0] * z, rays[1] * z, z])


def _moved(points: NDArray[np.float64], a: video_stream_profile, b: video_stream_profile) -> NDArray[np.float64]:
    matrix = b.left_to_stream @ np.linalg.inv(a.left_to_stream)
    return matrix[:3, :3] @ points + matrix[:3, 3:]


def _is_coarser(a: intrinsics, b: intrinsics) -> bool:
    """Whether a has fewer pixels to a degree than b."""
    mine, theirs = rs2_fov(a), rs2_fov(b)
    return a.width / mine[0] < b.width / theirs[0] or a.height / mine[1] < b.height / theirs[1]


def _pixels(depth: frame, target: video_stream_profile, corner_px: float) -> NDArray[np.int64]:
    """[2, n] pixels of the target that a corner of each measured pixel falls into."""
    at = projected(target.intrinsics, _moved(_points(depth, corner_px), depth.profile, target))
    return np.rint(at + _CORNER_PX).astype(np.int64)


def _depth_in_color(depth: frame, target: video_stream_profile) -> frame:
    """Moves each measured pixel to the color pixel of its upper left corner. If depth is the coarser image, it covers
    the rectangle between its corners. The nearest one stays. As in librealsense, depth keeps the depth camera's
    values."""
    lens, counts = target.intrinsics, np.asarray(depth.get_data())
    first = _pixels(depth, target, -_CORNER_PX)
    last = _pixels(depth, target, _CORNER_PX) if _is_coarser(depth.profile.intrinsics, lens) else first
    values, spans = counts[counts > 0], np.minimum(last - first, _WIDEST_PX)
    far = np.iinfo(np.uint16).max
    out = np.full((lens.height, lens.width), far, np.uint16)
    for dy in range(int(spans[1].max(initial=-1)) + 1):
        for dx in range(int(spans[0].max(initial=-1)) + 1):
            u, v = first[0] + dx, first[1] + dy
            covers = (dx <= spans[0]) & (dy <= spans[1]) & (u >= 0) & (v >= 0) & (u < lens.width) & (v < lens.height)
            np.minimum.at(out, (v[covers], u[covers]), values[covers])
    out[out == far] = 0
    return depth.changed(out, video_stream_profile(depth.profile.request, lens, target.left_to_stream).seen(lens))


def _color_in_depth(other: frame, depth: frame) -> frame:
    """The other frame's pixel at each measured depth; 0 elsewhere."""
    pixels, lens = np.asarray(other.get_data()), other.profile.intrinsics
    v, u = np.nonzero(np.asarray(depth.get_data()))
    at = _pixels(depth, other.profile, -_CORNER_PX)
    is_seen = (at[0] >= 0) & (at[0] < lens.width) & (at[1] >= 0) & (at[1] < lens.height)
    out = np.zeros((*np.asarray(depth.get_data()).shape, *pixels.shape[2:]), pixels.dtype)
    out[v[is_seen], u[is_seen]] = pixels[at[1, is_seen], at[0, is_seen]]
    seen = video_stream_profile(other.profile.request, depth.profile.intrinsics, depth.profile.left_to_stream)
    return other.changed(out, seen.seen(depth.profile.intrinsics))
