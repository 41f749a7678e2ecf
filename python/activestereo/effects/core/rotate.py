"""A camera turned about its centre: every pixel sees what another saw, whatever the depth."""

import numpy as np


def turned(light, view, axis, angle_rad):
    """The Light of a camera turned by angle_rad about its own `axis` (unit, camera coordinates), right-handed."""
    if angle_rad == 0.0:
        return light
    x, y, z = axis
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=np.float64)
    rotation = np.eye(3) + s * cross + (1 - c) * cross @ cross
    rx, ry = view.rays()
    ray = np.stack([rx, ry, np.ones_like(rx)], axis=-1) @ rotation.T
    u, v = view.to_pixels(ray[..., 0] / ray[..., 2], ray[..., 1] / ray[..., 2])
    return light.warped(u, v)
