# SPDX-License-Identifier: Apache-2.0
"""A camera turned about its centre, where every pixel sees what another saw, whatever the depth; and one moved along
its x axis by a little, where each pixel looks up by its own depth. Scene and dots stay where they are."""

import numpy as np

from activestereo.effects.core.engine import rotation
from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import sample
from activestereo.effects.core.view import View


def turned(light: Light, view: View, axis: tuple[float, float, float], angle_rad: float) -> Light:
    """The Light of a camera turned by angle_rad about its own `axis` (unit, camera coordinates), right-handed."""
    if angle_rad == 0.0:
        return light
    rx, ry = view.rays()
    ray = np.stack([rx, ry, np.ones_like(rx)], axis=-1) @ rotation(axis, angle_rad).T
    u, v = view.to_pixels(ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2])
    return light.warped(u, v)


_ITERATIONS = 3


def shifted(light: Light, view: View, shift_x_m: float) -> Light:
    """The Light of the camera moved by shift_x_m (camera coordinates). New occlusions are not seen: shifts are of a few
    pixels."""
    if shift_x_m == 0.0:
        return light
    u, v = view.pixels()
    inverse_depth = np.where(view.depth_m > 0, 1.0 / np.where(view.depth_m > 0, view.depth_m, 1.0), 0.0)
    source = u
    for _ in range(_ITERATIONS):
        source = u + view.K[0, 0] * shift_x_m * sample(inverse_depth, source, v, order=1)
    return light.warped(source, v)
