# SPDX-License-Identifier: Apache-2.0
"""Depth engines of pairs without a lens."""

import simsense
from activestereo.common.pose import rigid_motion


def depth_engine(size, focal_px, device="host", **settings):
    """Two equal cameras, 5 cm apart; device: a name or a device."""
    camera = simsense.Camera(*size, [[focal_px, 0, (size[0] - 1) / 2], [0, focal_px, (size[1] - 1) / 2], [0, 0, 1]])
    device = simsense.Device(device) if isinstance(device, str) else device
    return simsense.Engine(device, camera, camera, rigid_motion((-0.05, 0, 0)), **({"rectified": True} | settings))
