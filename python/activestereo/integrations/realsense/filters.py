# SPDX-License-Identifier: Apache-2.0
"""pyrealsense2's processing blocks: filters of depth (librealsense's doc/post-processing-filters), align, point clouds
and colours. Each processes a depth frame, or the depth frame of a frameset."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.common.output_files import write_ply
from activestereo.integrations.realsense.frames import (
    composite_frame,
    deprojected,
    frame,
    ignored,
    projected,
    video_frame,
    video_stream_profile,
)
from activestereo.integrations.realsense.options import Options, format, option, option_range, stream


class filter(Options):
    """Base of the blocks that filter depth frames. ranges: {option: its range}. arguments: {parameter of the subclass's
    constructor: (option that it sets, default)}, in librealsense's order."""

    ranges: dict[option, option_range] = {}
    arguments: dict[str, tuple[option, float]] = {}

    def __init__(self, *values: float, **named: float) -> None:
        super().__init__(self.ranges)
        given = dict(zip(self.arguments, values, strict=False)) | named
        if len(values) > len(self.arguments) or not set(given) <= set(self.arguments):
            raise TypeError(f"{type(self).__name__}() takes {', '.join(self.arguments) or 'nothing'}")
        for name, (which, default) in self.arguments.items():
            self.set_option(which, given.get(name, default))

    def process(self, given: frame) -> frame:
        """Returns the filtered frame; from a frameset, a frameset with its depth filtered."""
        if isinstance(given, composite_frame):
            parts = [self._filtered(one) if one.profile.stream_type() == stream.depth else one for one in given]
            return composite_frame(parts)
        return self._filtered(given)

    def _filtered(self, depth: frame) -> frame:
        raise NotImplementedError


class decimation_filter(filter):
    """Reduces resolution: each square of pixels becomes the median of its measured pixels, or their mean from a side of
    4 pixels on."""

    ranges = {option.filter_magnitude: option_range(1, 8, 1, 2)}

    arguments = {"magnitude": (option.filter_magnitude, 2)}

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
        own = depth.profile.intrinsics
        lens = replace(
            own, width=width, height=height, ppx=own.ppx / side, ppy=own.ppy / side, fx=own.fx / side, fy=own.fy / side
        )
        return depth.changed(out, depth.profile.seen(lens))


class threshold_filter(filter):
    """Keeps depth between min_distance and max_distance, metres, and sets other pixels to 0."""

    ranges = {option.min_distance: option_range(0, 16, 0.1, 0.1), option.max_distance: option_range(0, 16, 0.1, 4)}

    arguments = {"min_dist": (option.min_distance, 0.15), "max_dist": (option.max_distance, 4.0)}

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        z = pixels * depth.unit_m
        is_kept = (z >= self.get_option(option.min_distance)) & (z <= self.get_option(option.max_distance))
        return depth.changed(np.where(is_kept, pixels, 0).astype(pixels.dtype))


_DISPARITY_STEPS = 32


class disparity_transform(filter):
    """Converts depth to disparities, or back. Disparities are float32, in 1/32 pixel of the depth stream at the
    camera's own baseline. As in librealsense, depth stays depth if the camera's baseline is unknown."""

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


_FILL_RADIUS_PX = (0, 2, 4, 8, 16, 255)  # fills one pixel less


class spatial_filter(filter):
    """Smooths depth without crossing edges, by a recursive filter along rows, then columns, forth and back (Gastal and
    Oliveira, Domain Transform, ACM TOG 30(4), 2011). An edge is a step of more than filter_smooth_delta counts, or
    disparities."""

    ranges = {
        option.filter_magnitude: option_range(1, 5, 1, 2),
        option.filter_smooth_alpha: option_range(0.25, 1, 0.01, 0.5),
        option.filter_smooth_delta: option_range(1, 50, 1, 20),
        option.holes_fill: option_range(0, 5, 1, 0),
    }

    arguments = {
        "smooth_alpha": (option.filter_smooth_alpha, 0.5),
        "smooth_delta": (option.filter_smooth_delta, 20),
        "magnitude": (option.filter_magnitude, 2),
        "hole_fill": (option.holes_fill, 0),
    }

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        values, is_count = pixels.astype(np.float32), np.issubdtype(pixels.dtype, np.integer)
        alpha, delta = self.get_option(option.filter_smooth_alpha), self.get_option(option.filter_smooth_delta)
        radius = _FILL_RADIUS_PX[int(self.get_option(option.holes_fill))]
        along, far = values.T, delta + 0.5  # counts may differ by delta along rows
        for _ in range(int(self.get_option(option.filter_magnitude))):
            if is_count:  # fills as it smooths, and leaves the last column on its way there
                _sweep(along[:-1], alpha, far, radius, is_count)
                _sweep(along[::-1], alpha, far, radius, is_count)
            else:
                _sweep(along, alpha, delta)
                _sweep(along[::-1], alpha, delta)
            _sweep(values, alpha, delta, 0, is_count)
            _sweep(values[::-1], alpha, delta, 0, is_count)
        if not is_count:
            _sweep(along, 1.0, 0.0, radius)
            _sweep(along[:0:-1], 1.0, 0.0, radius)  # the first column keeps its holes
        return depth.changed(values.astype(pixels.dtype))


def _sweep(values: NDArray[np.float32], alpha: float, delta: float, radius_px: int = 0, is_count: bool = False) -> None:
    """Smooths and fills depth counts or disparities along the first axis, in place. A measured value becomes
    alpha x itself + (1 - alpha) x the one before it, unless they differ by delta or more. The first radius_px - 1
    pixels of a hole take the value before it. As in librealsense (src/proc/spatial-filter), counts are rounded and
    compared with smoothed neighbours, disparities with unsmoothed ones. A lone count between holes starts no fill."""
    before, compared = values[0].copy(), values[0].copy()
    run = np.zeros(values.shape[1], np.int64)
    for row in values[1:]:
        unsmoothed, is_measured = row.copy(), row > 0
        both = is_measured & (before > 0)
        moved = alpha * row + (1.0 - alpha) * before
        np.copyto(row, np.floor(moved + 0.5) if is_count else moved, where=both & (np.abs(row - compared) < delta))
        if radius_px:
            run[both if is_count else is_measured] = 0
            is_hole = ~is_measured & (before > 0)
            run[is_hole] += 1
            np.copyto(row, before, where=is_hole & (run < radius_px))
        before = row.copy()
        compared = before if is_count else unsmoothed


# {persistence: (least, count)}: a hole keeps its last value if at least `least` of the last `count` frames measured it.
_PERSISTENCE = {1: (8, 8), 2: (2, 3), 3: (2, 4), 4: (2, 8), 5: (1, 2), 6: (1, 5), 7: (1, 8)}
_ALWAYS = 8


class temporal_filter(filter):
    """Averages each pixel over frames if it changes by less than filter_smooth_delta. Its persistence (option
    holes_fill) decides when a hole keeps the last value."""

    ranges = {
        option.filter_smooth_alpha: option_range(0, 1, 0.01, 0.4),
        option.filter_smooth_delta: option_range(1, 100, 1, 20),
        option.holes_fill: option_range(0, 8, 1, 3),
    }

    arguments = {
        "smooth_alpha": (option.filter_smooth_alpha, 0.4),
        "smooth_delta": (option.filter_smooth_delta, 20),
        "persistence_control": (option.holes_fill, 3),
    }

    def __init__(self, *values: float, **named: float) -> None:
        super().__init__(*values, **named)
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
        mode = int(self.get_option(option.holes_fill))
        persists = np.full(values.shape, mode == _ALWAYS)
        if mode in _PERSISTENCE:
            least, count = _PERSISTENCE[mode]
            persists = np.sum(self._seen[-count:], axis=0) >= least
        fills = (values == 0) & (self._last > 0) & persists
        out = np.where(fills, self._last, out).astype(np.float32)
        self._seen = [*self._seen[-7:], values > 0]
        if np.issubdtype(pixels.dtype, np.integer):
            out = np.floor(out)
        self._last = np.where(out > 0, out, self._last)
        return depth.changed(out.astype(pixels.dtype))


class hole_filling_filter(filter):
    """Fills each hole with a neighbour's value. Mode 0 takes the left one, 1 the farthest and 2 the nearest of those
    around it."""

    ranges = {option.holes_fill: option_range(0, 2, 1, 1)}

    arguments = {"mode": (option.holes_fill, 1)}

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        values = pixels.astype(np.float32)
        mode = int(self.get_option(option.holes_fill))
        if mode == 0:
            _sweep(values.T, 1.0, 0.0, values.shape[1] + 1)
            return depth.changed(values.astype(pixels.dtype))
        rows, columns = values.shape
        for y, x in np.argwhere(values[1 : rows - 1, 1:columns] == 0) + 1:  # filled values count
            around = (values[y - 1, x], values[y - 1, x - 1], values[y, x - 1], values[y + 1, x - 1], values[y + 1, x])
            if mode == 1:
                values[y, x] = max(around)
            else:  # nothing above leaves the hole, as in librealsense
                values[y, x] = min((one for one in around if one > 0), default=0.0) if around[0] else 0.0
        return depth.changed(values.astype(pixels.dtype))


_CORNER_PX = 0.5  # a pixel covers the area between its corners
_WIDEST_PX = 15


class align:
    """Transfers the frames of a frameset to the image of `to`: depth to colour, or colour to depth."""

    def __init__(self, to: stream) -> None:
        self._to = to

    def process(self, frames: composite_frame) -> composite_frame:
        """Returns the aligned frameset. Raises RuntimeError if the frameset lacks depth or the target stream."""
        depth, target = frames.first(stream.depth), frames.first(self._to).profile
        if self._to == stream.depth:  # the other frames' pixels at each measured depth; 0 elsewhere
            aligned = [depth]
            for other in (one for one in frames if one.profile.stream_type() != stream.depth):
                pixels, lens = np.asarray(other.get_data()), other.profile.intrinsics
                v, u = np.nonzero(np.asarray(depth.get_data()))
                at = _pixels(depth, other.profile, -_CORNER_PX)
                is_seen = (at[0] >= 0) & (at[0] < lens.width) & (at[1] >= 0) & (at[1] < lens.height)
                out = np.zeros((*np.asarray(depth.get_data()).shape, *pixels.shape[2:]), pixels.dtype)
                out[v[is_seen], u[is_seen]] = pixels[at[1, is_seen], at[0, is_seen]]
                own = depth.profile
                profile = video_stream_profile(other.profile.request, own.intrinsics, own.left_to_stream)
                aligned.append(other.changed(out, profile.seen(own.intrinsics)))
            return composite_frame(aligned)
        # Each measured pixel moves to the colour pixel of its upper left corner. If depth is the coarser image, it
        # covers the rectangle between its corners. Where several fall on one pixel, the nearest stays. As in
        # librealsense, values remain depth in the depth camera.
        lens, counts = target.intrinsics, np.asarray(depth.get_data())
        first = _pixels(depth, target, -_CORNER_PX)
        densities = []  # pixels per radian of the field of view, horizontal and vertical
        for seen in (depth.profile.intrinsics, lens):
            for middle, size, focal_px in ((seen.ppx, seen.width, seen.fx), (seen.ppy, seen.height, seen.fy)):
                fov = np.arctan2(middle + 0.5, focal_px) + np.arctan2(size - middle - 0.5, focal_px)
                densities.append(size / fov)
        is_coarser = densities[0] < densities[2] or densities[1] < densities[3]
        last = _pixels(depth, target, _CORNER_PX) if is_coarser else first
        values, spans = counts[counts > 0], np.minimum(last - first, _WIDEST_PX)
        far = np.iinfo(np.uint16).max
        out = np.full((lens.height, lens.width), far, np.uint16)
        for dy in range(int(spans[1].max(initial=-1)) + 1):
            for dx in range(int(spans[0].max(initial=-1)) + 1):
                u, v = first[0] + dx, first[1] + dy
                covers = (dx <= spans[0]) & (dy <= spans[1])
                covers &= (u >= 0) & (v >= 0) & (u < lens.width) & (v < lens.height)
                np.minimum.at(out, (v[covers], u[covers]), values[covers])
        out[out == far] = 0
        profile = video_stream_profile(depth.profile.request, lens, target.left_to_stream).seen(lens)
        return composite_frame([depth.changed(out, profile) if one is depth else one for one in frames])


def _pixels(depth: frame, target: video_stream_profile, corner_px: float) -> NDArray[np.int64]:
    """Returns the target's pixels, [2, n], that a corner of each measured depth pixel falls into. corner_px: the
    corner's offset from the pixel's centre."""
    counts = np.asarray(depth.get_data())
    v, u = np.nonzero(counts)
    rays = deprojected(depth.profile.intrinsics, u + corner_px, v + corner_px)
    z = depth.unit_m * counts[v, u]
    points = np.stack([rays[0] * z, rays[1] * z, z])
    depth_to_target = target.left_to_stream @ np.linalg.inv(depth.profile.left_to_stream)
    moved = depth_to_target[:3, :3] @ points + depth_to_target[:3, 3:]
    at = projected(target.intrinsics, moved)
    return np.rint(at + _CORNER_PX).astype(np.int64)


_VERTEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
_TEXEL = np.dtype([("u", "<f4"), ("v", "<f4")])


class points(frame):
    """A point, metres, for each pixel of a depth frame, 0 = not measured, with texture coordinates 0..1."""

    def __init__(
        self, of: frame | None = None, vertices: NDArray[np.float32] | None = None,
        texels: NDArray[np.float32] | None = None,
    ) -> None:  # fmt: skip
        self._vertices = np.zeros((0, 3), np.float32) if vertices is None else vertices
        self._texels = np.zeros((len(self._vertices), 2), np.float32) if texels is None else texels
        if of is not None:
            super().__init__(self._vertices, of.profile, of.frame_number, of.timestamp, of.metadata, of.unit_m)

    def size(self) -> int:
        return len(self._vertices)

    def get_vertices(self, dims: int = 1) -> NDArray[Any]:
        """Returns the points as a structured array [n] with x, y, z, metres; with dims 2 as [n, 3]."""
        return self._vertices if dims == 2 else self._vertices.view(_VERTEX).reshape(-1)

    def get_texture_coordinates(self, dims: int = 1) -> NDArray[Any]:
        """Returns texture coordinates as a structured array [n] with u, v; with dims 2 as [n, 2]."""
        return self._texels if dims == 2 else self._texels.view(_TEXEL).reshape(-1)

    def export_to_ply(self, path: str | PathLike[str], texture: frame | None) -> None:
        """Writes the measured points, with the colours of `texture`, into a PLY file. texture: the frame given to
        map_to(); None: no colours."""
        measured = self._vertices[:, 2] > 0
        colors = None
        if texture is not None:
            pixels = np.asarray(texture.get_data())
            size = np.array(pixels.shape[1::-1])
            u, v = np.clip((self._texels[measured] * size).astype(np.int64), 0, size - 1).T
            colors = pixels[v, u].astype(np.float32) / 255.0
            if colors.ndim == 1:
                colors = np.repeat(colors[:, None], 3, axis=1)
            is_bgr = texture.profile.format() in (format.bgr8, format.bgra8)
            colors = np.ascontiguousarray(colors[:, 2::-1] if is_bgr else colors[:, :3])
        write_ply(str(path), self._vertices[measured], colors)


class pointcloud:
    """Computes a 3D point for each pixel of a depth frame."""

    _mapped: frame | None = None

    def map_to(self, mapped: frame) -> None:
        """Sets the frame, such as a colour image, to whose pixels the texture coordinates of later points refer."""
        self._mapped = mapped

    def calculate(self, depth: frame) -> points:
        counts, lens = np.asarray(depth.get_data()), depth.profile.intrinsics
        v, u = np.indices(counts.shape)
        x, y = deprojected(lens, u.astype(np.float64), v.astype(np.float64))
        z = counts * depth.unit_m
        vertices = np.stack([x * z, y * z, z], axis=-1).reshape(-1, 3).astype(np.float32)
        texels = None
        if self._mapped is not None:
            to = self._mapped.profile
            matrix = to.left_to_stream @ np.linalg.inv(depth.profile.left_to_stream)
            moved = matrix[:3, :3] @ vertices.T.astype(np.float64) + matrix[:3, 3:]
            is_seen = (vertices[:, 2] > 0) & (moved[2] > 0)
            pixel = projected(to.intrinsics, moved[:, is_seen])
            texels = np.zeros((len(vertices), 2), np.float32)
            texels[is_seen] = np.stack([pixel[0] / to.width(), pixel[1] / to.height()], axis=1)
        return points(depth, vertices, texels)

    def process(self, frames: frame) -> points:
        """Returns the points of a depth frame, or of a frameset's depth."""
        return self.calculate(frames.first(stream.depth) if isinstance(frames, composite_frame) else frames)


class save_to_ply(filter):
    """Writes the points of each frame or frameset into one PLY file, which the next one overwrites. Options of its
    format are accepted without effect."""

    option_ignore_color, option_ply_mesh, option_ply_binary, option_ply_normals, option_ply_threshold = range(100, 105)

    def __init__(self, filename: str = "RealSense Pointcloud ", pc: pointcloud | None = None) -> None:
        super().__init__()
        self._path, self._cloud = filename, pc or pointcloud()

    set_option = ignored  # the file is binary, with colours if there are any

    def process(self, given: frame) -> frame:
        texture = None
        if isinstance(given, composite_frame):
            texture = given.get_color_frame() or given.get_infrared_frame()
            if texture is not None:
                self._cloud.map_to(texture)
        self._cloud.process(given).export_to_ply(self._path, texture)
        return given


# Piecewise linear colours from near to far, 0..1.
_SCHEMES = {
    0: ((0, 0, 1), (0, 1, 1), (1, 1, 0), (1, 0, 0), (0.2, 0, 0)),
    2: ((1, 1, 1), (0, 0, 0)),
    3: ((0, 0, 0), (1, 1, 1)),
}


class colorizer(filter):
    """Colours depth as rgb8. With histogram_equalization_enabled all colours have equal shares of the pixels; otherwise
    they are linear in depth."""

    ranges = {
        option.color_scheme: option_range(0, 9, 1, 0),
        option.histogram_equalization_enabled: option_range(0, 1, 1, 1),
        option.min_distance: option_range(0, 16, 0.1, 0),
        option.max_distance: option_range(0, 16, 0.1, 6),
    }

    arguments = {"color_scheme": (option.color_scheme, 0)}

    def process(self, given: frame) -> frame:
        """Returns the coloured depth; from a frameset, the frameset with the coloured depth at its end."""
        if isinstance(given, composite_frame):
            return composite_frame([*given, self._filtered(given.first(stream.depth))])
        return self._filtered(given)

    def _filtered(self, depth: frame) -> frame:
        pixels = np.asarray(depth.get_data())
        measured = pixels > 0
        share = np.zeros(pixels.shape)
        if self.get_option(option.histogram_equalization_enabled) and measured.any():
            values, place, counts = np.unique(pixels[measured], return_inverse=True, return_counts=True)
            share[measured] = (np.cumsum(counts) / counts.sum())[place]
        else:
            near, far = self.get_option(option.min_distance), self.get_option(option.max_distance)
            share = np.clip((pixels * depth.unit_m - near) / max(far - near, 1e-6), 0.0, 1.0)
        scheme = np.array(_SCHEMES.get(int(self.get_option(option.color_scheme)), _SCHEMES[0]), float)
        at = np.linspace(0.0, 1.0, len(scheme))
        rgb = np.stack([np.interp(share, at, scheme[:, c]) for c in range(3)], axis=-1)
        out = np.where(measured[..., None], np.rint(255.0 * rgb), 0).astype(np.uint8)
        profile = depth.profile.seen(depth.profile.intrinsics, format.rgb8)
        return video_frame(out, profile, depth.frame_number, depth.timestamp, depth.metadata, depth.unit_m)

    colorize = _filtered
