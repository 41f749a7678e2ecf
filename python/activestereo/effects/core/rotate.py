# SPDX-License-Identifier: Apache-2.0
"""A camera turned about its centre: every pixel sees what another saw, whatever the depth."""

import numpy as np

from activestereo.effects.core.engine import rotation
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


def turned(light: Light, view: View, axis: tuple[float, float, float], angle_rad: float) -> Light:
    """The Light of a camera turned by angle_rad about its own `axis` (unit, camera coordinates), right-handed."""
    if angle_rad == 0.0:
        return light
    rx, ry = view.rays()
    ray = np.stack([rx, ry, np.ones_like(rx)], axis=-1) @ rotation(axis, angle_rad).T
    u, v = view.to_pixels(ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2])
    return light.warped(u, v)
