# SPDX-License-Identifier: Apache-2.0
"""Registers a depth image of the left infrared camera to the RGB camera without the depth engine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from activestereo.camera.plan import SensorPlan
from activestereo.common.lens import is_distorting, is_drawn, to_pixels, to_tangents


def registered(
    depth_m: NDArray[np.float32], k: NDArray[np.float64], left_to_rectified: NDArray[np.float64], plan: SensorPlan
) -> NDArray[np.float32]:
    """Returns depth registered to the RGB camera, float32 [height, width], metres, 0 = none. Each point falls on its
    nearest pixel; the nearest surface wins. With depth_dilation, a point also covers the pixels up and left of it.
    depth_m: of the rectified left image, metres. k: that image's 3x3. left_to_rectified: 4x4 from the left camera's
    axes to the rectified ones."""
    rgb, matcher, left_to_rgb = plan.rgb, plan.engine, plan.left_to["rgb"]
    v, u = np.nonzero(depth_m)
    z = depth_m[v, u].astype(np.float64)
    x, y = to_tangents(u, v, k)
    points = np.stack([x * z, y * z, z])
    rotation, offset = left_to_rgb[:3, :3] @ left_to_rectified[:3, :3].T, left_to_rgb[:3, 3:]
    x, y, z = rotation @ points + offset
    ahead = z > 0
    x, y, z = x[ahead] / z[ahead], y[ahead] / z[ahead], z[ahead]
    if is_distorting(rgb["distortion"]):
        drawn = is_drawn(x, y, rgb["distortion"])
        x, y, z = x[drawn], y[drawn], z[drawn]
    width, height = rgb["width"], rgb["height"]
    column, row = (np.rint(place).astype(int) for place in to_pixels(x, y, rgb["k"], rgb["distortion"]))
    out = np.full((height, width), np.inf, np.float32)
    covered = (0, 1) if matcher["depth_dilation"] else (0,)
    for down in covered:
        for right in covered:
            r, c = row - down, column - right
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            np.minimum.at(out, (r[inside], c[inside]), z[inside].astype(np.float32))
    out[~np.isfinite(out) | (out < matcher["min_depth_m"]) | (out >= matcher["max_depth_m"])] = 0.0
    return out
