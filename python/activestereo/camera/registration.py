# SPDX-License-Identifier: Apache-2.0
"""A depth image of the left infrared camera in the RGB camera, for what is computed outside of the depth engine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from activestereo.common.lens import distort, is_distorting, is_drawn
from activestereo.common.pose import Pose, camera_to_camera

if TYPE_CHECKING:
    from activestereo.camera.presets import StereoDepthSensorConfig


def registered(
    depth_m: NDArray[np.float32],
    k: NDArray[np.float64],
    left_to_rectified: NDArray[np.float64],
    config: StereoDepthSensorConfig,
) -> NDArray[np.float32]:
    """float32 [height][width] of the RGB camera, metres, 0 = none: nearest pixels, the nearest surface wins. depth_m,
    k: of the rectified left image. config.depth_dilation: each point covers the pixels up and left of it, too."""
    v, u = np.nonzero(depth_m)
    z = depth_m[v, u].astype(np.float64)
    points = np.stack([(u - k[0, 2]) / k[0, 0] * z, (v - k[1, 2]) / k[1, 1] * z, z])
    left_to_rgb = camera_to_camera(config.trans_pose_l, Pose())
    rotation, offset = left_to_rgb[:3, :3] @ left_to_rectified[:3, :3].T, left_to_rgb[:3, 3:]
    x, y, z = rotation @ points + offset
    width, height = config.rgb_resolution
    ahead = z > 0
    x, y, z = x[ahead] / z[ahead], y[ahead] / z[ahead], z[ahead]
    if is_distorting(config.rgb_distortion):
        drawn = is_drawn(x, y, config.rgb_distortion)
        x, y = distort(x[drawn], y[drawn], config.rgb_distortion)
        z = z[drawn]
    rgb_k = config.rgb_intrinsic
    column = np.rint(rgb_k[0, 0] * x + rgb_k[0, 1] * y + rgb_k[0, 2]).astype(int)
    row = np.rint(rgb_k[1, 1] * y + rgb_k[1, 2]).astype(int)
    out = np.full((height, width), np.inf, np.float32)
    for down in (0, 1) if config.depth_dilation else (0,):
        for right in (0, 1) if config.depth_dilation else (0,):
            r, c = row - down, column - right
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            np.minimum.at(out, (r[inside], c[inside]), z[inside].astype(np.float32))
    out[~np.isfinite(out) | (out < config.min_depth_m) | (out >= config.max_depth_m)] = 0.0
    return out
