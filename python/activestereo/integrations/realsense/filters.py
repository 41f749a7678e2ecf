# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's post-processing filters of depth, after librealsense's doc/post-processing-filters. Each
takes a depth frame, or a frameset whose depth it filters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from activestereo.integrations.realsense.enums import format, option, stream
from activestereo.integrations.realsense.frames import composite_frame, frame
from activestereo.integrations.realsense.options import Options, option_range


class filter(Options):
    """One filter. process() returns its input, filtered."""

    ranges: dict[option, option_range] = {}

    def __init__(self) -> None:
        super().__init__(self.ranges)

    def process(self, given: frame) -> frame:
        """A frame, or a frameset with its depth filtered."""
        if isinstance(given, composite_frame):
            parts = [self._filtered(one) if one.profile.stream_type() == stream.depth else one for one in given]
            return composite_frame(parts)
        return self._filtered(given)

    def _filtered(self, depth: frame) -> frame:
        raise NotImplementedError


class decimation_filter(filter):
    """Fewer pixels: each square becomes the median of its measured pixels, from side 4 on their mean."""

    ranges = {option.filter_magnitude: option_range(1, 8, 1, 2)}

    def __init__(self, magnitude: float = 2) -> None:
        super().__init__()
        self.set_option(option.filter_magnitude, magnitude)

    def _filtered(self, depth: frame) -> frame:
        side = int(self.get_option(option.filter_magnitude))
        if side == 1:
            return depth
        pixels = np.asarray(depth.get_data())
        height, width = (n // side for n in pixels.shape[:2])
        blocks = pixels[: height * side, : width * side].reshape(height, side, width, side).swapaxes(1, 2)
        values = blocks.reshape(height, width, side * side)
        measured = np.count_nonzero(values, axis=-1)
        if side < 4:  # the lower median
            place = np.minimum(side * side - 1, side * side - measured + np.maximum(measured - 1, 0) // 2)
            reduced = np.take_along_axis(np.sort(values, axis=-1), place[..., None], -1)[..., 0]
        else:
            reduced = values.sum(axis=-1, dtype=np.float64) / np.maximum(measured, 1)
        out = reduced.astype(pixels.dtype)
        out = np.pad(out, ((0, -height % 4), (0, -width % 4)))  # both sides are multiples of 4
        height, width = out.shape
        lens = depth.profile.intrinsics.divided(side)
        lens.width, lens.height = width, height
        return depth.changed(out, depth.profile.seen(lens))


class threshold_filter(filter):
    """Depth between two distances, metres."""

    ranges = {option.min_distance: option_range(0, 16, 0.1, 0.1), option.max_distance: option_range(0, 16, 0.1, 4)}

    def __init__(self, min_dist: float = 0.15, max_dist: float = 4.0) -> None:
        super().__init__()
        self.set_option(option.min_distance, min_dist)
        self.set_option(option.max_distance, max_dist)

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        z = pixels * depth.unit_m
        is_kept = (z >= self.get_option(option.min_distance)) & (z <= self.get_option(option.max_distance))
        return depth.changed(np.where(is_kept, pixels, 0).astype(pixels.dtype))


_DISPARITY_STEPS = 32


class disparity_transform(filter):
    """Depth as disparities, or back; disparities are float32, 1/32 pixel of the depth stream at the camera's own
    baseline. As in librealsense, depth of a camera that tells no baseline stays depth."""

    def __init__(self, transform_to_disparity: bool = True) -> None:
        super().__init__()
        self._to_disparity = transform_to_disparity

    def _filtered(self, depth: frame) -> frame:
        is_disparity = depth.profile.format() == format.disparity32
        if is_disparity == self._to_disparity or depth.profile.baseline_m is None:
            return depth
        pixels = np.asarray(depth.get_data(), np.float64)
        factor = _DISPARITY_STEPS * depth.profile.baseline_m * depth.profile.intrinsics.fx / depth.unit_m
        with np.errstate(divide="ignore"):
            out = np.where(pixels > 0, factor / pixels, 0.0)
        if self._to_disparity:
            profile = depth.profile.seen(depth.profile.intrinsics, format.disparity32)
            return depth.changed(out.astype(np.float32), profile)
        counts = np.clip(np.floor(out + 0.5), 0, np.iinfo(np.uint16).max).astype(np.uint16)
        return depth.changed(counts, depth.profile.seen(depth.profile.intrinsics, format.z16))


_FILL_RADIUS_PX = (0, 2, 4, 8, 16, 10**6)


class spatial_filter(filter):
    """Smooths without crossing edges: a recursion along rows, then columns, forth and back (Gastal and Oliveira, Domain
    Transform, ACM TOG 30(4), 2011). An edge is a step of more than filter_smooth_delta counts, or disparities."""

    ranges = {
        option.filter_magnitude: option_range(1, 5, 1, 2),
        option.filter_smooth_alpha: option_range(0.25, 1, 0.01, 0.5),
        option.filter_smooth_delta: option_range(1, 50, 1, 20),
        option.holes_fill: option_range(0, 5, 1, 0),
    }

    def __init__(
        self, smooth_alpha: float = 0.5, smooth_delta: float = 20, magnitude: float = 2, hole_fill: float = 0
    ) -> None:
        super().__init__()
        for which, value in (
            (option.filter_smooth_alpha, smooth_alpha), (option.filter_smooth_delta, smooth_delta),
            (option.filter_magnitude, magnitude), (option.holes_fill, hole_fill),
        ):  # fmt: skip
            self.set_option(which, value)

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        values = pixels.astype(np.float32)
        alpha, delta = self.get_option(option.filter_smooth_alpha), self.get_option(option.filter_smooth_delta)
        half = 0.5 if np.issubdtype(pixels.dtype, np.integer) else 0.0  # counts are rounded at each step
        for _ in range(int(self.get_option(option.filter_magnitude))):
            along = values.T
            _smooth(along[:-1], alpha, np.nextafter(delta, np.inf), half)
            _smooth(along[::-1], alpha, np.nextafter(delta, np.inf), half)
            _smooth(values, alpha, delta, half)
            _smooth(values[::-1], alpha, delta, half)
        radius = _FILL_RADIUS_PX[int(self.get_option(option.holes_fill))]
        if radius:
            _fill_rows(values, radius)
        return depth.changed(values.astype(pixels.dtype))


def _smooth(values: NDArray[np.float32], alpha: float, delta: float, half: float) -> None:
    """Along the first axis, in place: each measured value moves towards the one before it, unless there is an edge."""
    before = values[0].copy()
    for row in values[1:]:
        is_smooth = (row > 0) & (before > 0) & (np.abs(row - before) < delta)
        moved = alpha * row + (1.0 - alpha) * before
        np.copyto(row, np.floor(moved + half) if half else moved, where=is_smooth)
        before = row


def _fill_rows(values: NDArray[np.float32], radius_px: int) -> None:
    """Holes of at most so many pixels take the value on their left, in place."""
    since = np.zeros(values.shape[0], np.int64)
    for x in range(1, values.shape[1]):
        is_hole = values[:, x] == 0
        since = np.where(is_hole, since + 1, 0)
        takes = is_hole & (since <= radius_px)
        values[takes, x] = values[takes, x - 1]


# Persistence: of the last frames so many must have measured a pixel for its last value to stand in a hole.
_PERSISTENCE = {1: (8, 8), 2: (2, 3), 3: (2, 4), 4: (2, 8), 5: (1, 2), 6: (1, 5), 7: (1, 8)}
_ALWAYS = 8


class temporal_filter(filter):
    """Averages each pixel over frames if it changes by less than filter_smooth_delta. holes_fill, the persistence,
    keeps values in holes."""

    ranges = {
        option.filter_smooth_alpha: option_range(0, 1, 0.01, 0.4),
        option.filter_smooth_delta: option_range(1, 100, 1, 20),
        option.holes_fill: option_range(0, 8, 1, 3),
    }

    def __init__(self, smooth_alpha: float = 0.4, smooth_delta: float = 20, persistence_control: int = 3) -> None:
        super().__init__()
        self.set_option(option.filter_smooth_alpha, smooth_alpha)
        self.set_option(option.filter_smooth_delta, smooth_delta)
        self.set_option(option.holes_fill, persistence_control)
        self._last: NDArray[np.float32] | None = None
        self._seen: list[NDArray[np.bool_]] = []

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        values = pixels.astype(np.float32)
        if self._last is None or self._last.shape != values.shape:
            self._last, self._seen = values.copy(), [values > 0]
            return depth
        alpha, delta = self.get_option(option.filter_smooth_alpha), self.get_option(option.filter_smooth_delta)
        is_steady = (values > 0) & (self._last > 0) & (np.abs(values - self._last) < delta)
        out = np.where(is_steady, alpha * values + (1.0 - alpha) * self._last, values)
        fills = (values == 0) & (self._last > 0) & self._persists(values.shape)
        out = np.where(fills, self._last, out).astype(np.float32)
        self._seen = [*self._seen[-7:], values > 0]
        if np.issubdtype(pixels.dtype, np.integer):
            out = np.floor(out)
        self._last = np.where(out > 0, out, self._last)
        return depth.changed(out.astype(pixels.dtype))

    def _persists(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        mode = int(self.get_option(option.holes_fill))
        if mode in (0, _ALWAYS):
            return np.full(shape, mode == _ALWAYS)
        least, of = _PERSISTENCE[mode]
        return np.sum(self._seen[-of:], axis=0) >= least


class hole_filling_filter(filter):
    """Each hole takes a neighbour: 0 the one on its left, 1 the farthest and 2 the nearest of those around it."""

    ranges = {option.holes_fill: option_range(0, 2, 1, 1)}

    def __init__(self, mode: int = 1) -> None:
        super().__init__()
        self.set_option(option.holes_fill, mode)

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        values = pixels.astype(np.float32)
        mode = int(self.get_option(option.holes_fill))
        if mode == 0:
            _fill_rows(values, values.shape[1])
            return depth.changed(values.astype(pixels.dtype))
        rows, columns = values.shape
        for y, x in np.argwhere(values[1 : rows - 1, 1:columns] == 0) + 1:  # filled values count
            around = (values[y - 1, x], values[y - 1, x - 1], values[y, x - 1], values[y + 1, x - 1], values[y + 1, x])
            if mode == 1:
                values[y, x] = max(around)
            else:  # nothing above leaves the hole, as in librealsense
                values[y, x] = min((one for one in around if one > 0), default=0.0) if around[0] else 0.0
        return depth.changed(values.astype(pixels.dtype))
