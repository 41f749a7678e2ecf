# SPDX-License-Identifier: Apache-2.0
"""Warps depth to the view of a second camera, and finds the physical cause of each pixel without depth, for sensors on
G-buffers and path-traced ones. simsense's 'reason' only names the check that refused the pixel."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

import kuafu
import simsense
from activestereo.camera.plan import ir_intrinsics
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.lens import is_distorting
from activestereo.common.pose import PoseLike, camera_to_camera

# Largest offset from the row, and largest rotation, of a view that is still warped along rows.
_ASIDE_M, _TURNED_RAD = 5e-3, 0.02


def require_row(here: PoseLike, there: PoseLike, what: str) -> None:
    """Raises ValueError if the rows of the views `here` and `there` do not align: `there` is rotated against `here`, or
    is above, below, before or behind it. what: its name in the message."""
    place = np.linalg.inv(camera_to_camera(here, there))
    turned = float(np.arccos(np.clip((np.trace(place[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
    x, y, z = place[:3, 3].tolist()
    if turned > _TURNED_RAD or max(abs(y), abs(z)) > _ASIDE_M:
        text = f"{what} stands at {np.round([x, y, z], 4).tolist()} m, turned by {turned:.3f} rad, from the left camera"
        raise ValueError(f"{text}: G-buffers are warped along rows, which it has to share")


def inverse_depth(depth: NDArray[Any]) -> NDArray[np.float64]:
    """Returns 1 / depth, with 0 where depth is 0 or infinite. Raises ValueError for negative depth or NaN."""
    if not ((depth >= 0.0) | np.isposinf(depth)).all():
        raise ValueError(f"a depth is {float(np.nanmin(depth)):g} m or no number, expected depths of 0 or more")
    with np.errstate(divide="ignore", over="ignore"):
        inverse = 1.0 / np.asarray(depth, np.float64)
    return np.where(np.isinf(inverse), 0.0, inverse)


# Largest slant (tangent) of one surface: neighbours whose depths differ by more are two surfaces.
_STEEPEST = 8.0
# A surface that stretches over more target pixels between two source pixels is torn there.
_MOST_PIXELS = 3


class Warped(NamedTuple):
    """The view of a second camera, computed from a first camera's depth; each array is [E, height, width].
    inverse_depth: 1/m in the second camera. pixel: index into the first camera's flattened images, of the pixel with
    the same surface. seen: false in holes, to which no pixel of the first camera maps; the farther edge fills them."""

    inverse_depth: NDArray[np.float64]
    pixel: NDArray[np.intp]
    seen: NDArray[np.bool_]


def warped(inverse_depth: NDArray[np.float64], focal_px: float, baseline_m: float, shift_px: float = 0.0) -> Warped:
    """Computes the view of a second camera, baseline_m to the right (negative: left) of a rectified first one. Both
    have one focal length; the second principal point lies shift_px further right. inverse_depth: the first camera's,
    [E, height, width], 1/m, 0 = infinitely far.

    If two pixels map to one target pixel and the shift is to the left, the nearer one comes later in its row. Writing
    in row order therefore keeps the nearer one (McMillan 1997, occlusion-compatible order)."""
    count, height, width = inverse_depth.shape
    is_mirrored = baseline_m < 0
    near = inverse_depth[..., ::-1] if is_mirrored else inverse_depth
    u = np.arange(width, dtype=np.float64)
    x = u - focal_px * abs(baseline_m) * near + (-shift_px if is_mirrored else shift_px)
    rows = np.arange(count * height, dtype=np.intp).reshape(count, height, 1) * width

    a, b = near[..., :-1], near[..., 1:]
    # |za - zb| < tan * min(z) / f, in inverse depths.
    is_one = np.abs(a - b) * focal_px <= _STEEPEST * np.minimum(a, b)
    is_one |= (a == 0.0) & (b == 0.0)
    left, right = x[..., :-1], x[..., 1:]
    is_one &= right > left
    first = np.ceil(left)
    out = np.full((count, height, width), -1.0)
    source = np.zeros((count, height, width), np.intp)
    place = first[..., None] + np.arange(_MOST_PIXELS)
    share = (place - left[..., None]) / np.where(is_one, right - left, 1.0)[..., None]
    is_hit = is_one[..., None] & (share <= 1.0) & (place >= 0) & (place < width)
    target = (rows[..., None] + np.where(is_hit, place, 0.0).astype(np.intp))[is_hit]
    value = (a[..., None] + share * (b - a)[..., None])[is_hit]
    column = (u[:-1, None] + (share > 0.5))[is_hit].astype(np.intp)
    out.ravel()[target] = value
    source.ravel()[target] = target // width * width + column

    # Each pixel reaches half a pixel to each side. At edges it covers the farther surface, and it closes gaps.
    middle = np.rint(x)
    inside = (middle >= 0) & (middle < width)
    target = (rows + np.where(inside, middle, 0.0).astype(np.intp))[inside]
    own, columns = near[inside], np.broadcast_to(u.astype(np.intp), near.shape)[inside]
    is_nearer = own > out.ravel()[target] * (1.0 + _STEEPEST / focal_px)
    target, own, columns = target[is_nearer], own[is_nearer], columns[is_nearer]
    out.ravel()[target] = own
    source.ravel()[target] = target // width * width + columns

    seen = out >= 0.0
    filled = _filled(out, seen)
    value = np.take_along_axis(out, filled, axis=-1)
    pixel = np.take_along_axis(source, filled, axis=-1)
    if is_mirrored:
        pixel = pixel // width * width + (width - 1 - pixel % width)
        return Warped(np.maximum(value, 0.0)[..., ::-1], pixel[..., ::-1], seen[..., ::-1])
    return Warped(np.maximum(value, 0.0), pixel, seen)


def in_front(
    beside: NDArray[np.float64], column: NDArray[np.float64], inverse_depth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the difference of two cameras' inverse depths, 1/m; above 0 the other camera sees a nearer surface. It is
    `beside`, the other camera's inverse depth, at `column` of the same row, less inverse_depth. Columns outside the
    image read its nearest column."""
    place = np.clip(np.rint(column), 0, beside.shape[-1] - 1).astype(np.intp)
    return np.take_along_axis(beside, place, axis=-1) - inverse_depth


def _filled(inverse: NDArray[np.float64], seen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Returns for each pixel the column to copy from: its own if `seen`; in a hole, the column of the nearest `seen`
    pixel to the left or right, whichever is farther away in depth."""
    width = inverse.shape[-1]
    u = np.broadcast_to(np.arange(width), inverse.shape)
    before = np.maximum.accumulate(np.where(seen, u, -1), axis=-1)
    after = np.minimum.accumulate(np.where(seen, u, width)[..., ::-1], axis=-1)[..., ::-1]
    has_before, has_after = before >= 0, after < width
    before, after = np.where(has_before, before, 0), np.where(has_after, after, width - 1)
    farther = np.take_along_axis(inverse, before, -1) <= np.take_along_axis(inverse, after, -1)
    return np.where(seen, u, np.where(has_before & (farther | ~has_after), before, np.where(has_after, after, u)))


Floats = NDArray[np.float64]
# A pixel gets the first cause that holds, in this order; 'measured' comes last.
CAUSES = (
    "measured",
    "nothing",  # no surface there
    "out_of_range",  # depth or disparity beyond the sensor's limits
    "outside",  # outside the right camera's image, or at its border
    "occluded",  # hidden from the right camera
    "saturated",
    "mirror_or_glass",  # shows light of several reflections
    "shadow",  # no direct light of the projector
    "edge",  # another surface's depth lies within the matcher's block
    "too_dark",
    "low_contrast",
    "not_unique",
    "checks",  # any other check of the matcher
)
# Depths whose disparities differ by more than this belong to two surfaces.
_EDGE_PX = 1.0
# Largest relative disparity change of a slanted surface within a block, chosen from ten random scenes.
_SLANT = 0.1
_HIDDEN_PX = 1.0
_SATURATED_SHARE = 0.1  # share of the block's pixels


def hidden_from_right(
    config: StereoDepthSensorConfig, inverse_depth: Floats, right_inverse_depth: Floats
) -> NDArray[np.bool_]:
    """Returns [E, height, width]: whether a nearer surface hides the left view's pixel from the right camera. Takes
    both views' inverse depths, 1/m."""
    column = _right_column(config, inverse_depth)
    in_front_px = config.focal_baseline_px_m * in_front(right_inverse_depth, column, inverse_depth)
    return np.asarray((in_front_px > _HIDDEN_PX) & (column >= 0))


def _right_column(config: StereoDepthSensorConfig, inverse_depth: Floats) -> Floats:
    """Returns the column, in pixels, at which the right image shows the surface of each pixel of the left image, [E,
    height, width]. inverse_depth: the left image's, 1/m."""
    k_left, k_right = ir_intrinsics(config, False)[0], ir_intrinsics(config, True)[0]
    disparity = config.focal_baseline_px_m * inverse_depth
    return np.asarray(np.arange(disparity.shape[-1]) - disparity + (k_right[0, 2] - k_left[0, 2]))


def causes(
    config: StereoDepthSensorConfig, inverse_depth: Floats, mirrors_or_is_glass: NDArray[np.bool_],
    is_lit: NDArray[np.bool_], is_hidden: NDArray[np.bool_], counts: NDArray[np.integer], reason: NDArray[np.uint8],
    black_dn: float, max_dn: float,
) -> NDArray[np.uint8]:  # fmt: skip
    """Returns why each pixel has no depth, or that it is measured: uint8 [E, height, width], an index into CAUSES. All
    images are the left camera's. inverse_depth: 1/m. is_lit: the projector lights the pixel. is_hidden: a nearer
    surface hides it from the right camera. counts: the noisy image, DN, with black level black_dn and full scale
    max_dn. reason: the matcher's verdict, an index into simsense.REASONS."""
    own = config.focal_baseline_px_m * inverse_depth
    block = (1, config.block_height, config.block_width)
    # A block compares census words, whose windows reach beyond its border.
    reach = (1, config.block_height + config.census_height - 1, config.block_width + config.census_width - 1)
    steps = maximum_filter(own, reach, mode="nearest") - minimum_filter(own, reach, mode="nearest")
    mean, deviation = mean_and_deviation(np.asarray(counts, np.float64) - black_dn, block)
    with np.errstate(divide="ignore"):
        depth = 1.0 / inverse_depth
    column = _right_column(config, inverse_depth)
    floor_dn = max(float(config.min_texture_dn), 1.0)
    holds = {
        "measured": reason == simsense.REASONS.index("valid"),
        "nothing": inverse_depth == 0.0,
        "out_of_range": (depth < config.min_depth_m) | (depth > config.max_depth_m) | (own >= config.max_disparity),
        "outside": column < config.census_width // 2,  # the other pixel's census word is cut off
        "occluded": is_hidden,
        "saturated": uniform_filter((counts >= max_dn).astype(np.float64), block, mode="nearest") > _SATURATED_SHARE,
        "mirror_or_glass": mirrors_or_is_glass,
        "shadow": ~is_lit,
        "edge": (steps > _EDGE_PX + _SLANT * own) | maximum_filter(is_hidden, reach),  # of either camera's view
        "too_dark": mean < 2.0 * floor_dn,
        "low_contrast": (deviation < 2.0 * floor_dn) | (reason == simsense.REASONS.index("low_texture")),
        "not_unique": reason == simsense.REASONS.index("not_unique"),
    }
    numbers = [CAUSES.index(name) for name in holds]
    return np.select(list(holds.values()), numbers, CAUSES.index("checks")).astype(np.uint8)


_MIRROR_ROUGHNESS = 0.45


def mirrors_or_is_glass(material: kuafu.Material) -> bool:
    """Returns whether the material is a smooth metal or transmits most light, so that it shows other surfaces."""
    return material.transmission > 0.5 or (material.metallic > 0.5 and material.roughness < _MIRROR_ROUGHNESS)


_NOTHING = 0xFFFFFFFF


def traced_causes(sensor: Any, reason: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Returns why each pixel of the left camera has no depth: uint8 [height, width], an index into CAUSES, for the
    scene as it is now. sensor: a StereoDepthSensor; reason: its depth map 'reason'. Raises ValueError for a sensor that
    rectifies its images."""
    config = sensor.get_config()
    if not config.rectified or any(is_distorting(ir_intrinsics(config, is_right)[1]) for is_right in (False, True)):
        raise ValueError("causes are told of pairs that are matched as they come: rectified=True, and no distortion")
    inputs = sensor.engine_inputs()
    depth, numbers = (sensor.get_picture(name, "left")[None, ..., 0] for name in ("depth", "material_id"))
    own = inverse_depth(np.where(numbers == _NOTHING, np.float32(0.0), depth))
    is_odd = np.zeros(own.shape, bool)
    for number in np.unique(numbers[own > 0]).tolist():
        if mirrors_or_is_glass(sensor.scene.get_material(number)):
            is_odd |= numbers == number
    beside = inverse_depth(sensor.get_picture("depth", "right")[None, ..., 0])
    is_lit = sensor.get_picture("projector_visibility", "left")[None, ..., 0] > 0.5
    is_hidden = hidden_from_right(config, own, beside)
    counts, black_dn = sensor.get_ir_measured()[0][None], float(inputs.left.signal["black_level_dn"])
    return causes(config, own, is_odd, is_lit, is_hidden, counts, reason[None], black_dn, inputs.max_dn)[0]


def mean_and_deviation(
    images: NDArray[Any], window: tuple[int, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (mean, standard deviation) over a window around each pixel. Borders repeat the edge pixels. window: its
    size in pixels along each axis of `images`."""
    values = np.asarray(images, np.float64)
    mean = uniform_filter(values, window, mode="nearest")
    return mean, np.sqrt(np.maximum(uniform_filter(values**2, window, mode="nearest") - mean**2, 0.0))
