# SPDX-License-Identifier: Apache-2.0
"""Finds the physical cause of each pixel without depth from G-buffers of the infrared cameras, also for a path-traced
sensor. simsense's 'reason' only names the matcher's check that refused the pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

import simsense
from activestereo.camera.plan import ir_intrinsics
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.common.lens import is_distorting
from activestereo.common.window_statistics import mean_and_deviation
from activestereo.sensor.gbuffer.inputs import mirrors_or_is_glass
from activestereo.sensor.gbuffer.warp import in_front, inverse_depth

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
# Relative disparity change of a slanted surface within a block; restored pixels of ten random worlds gave it.
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
