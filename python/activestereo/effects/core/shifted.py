# SPDX-License-Identifier: Apache-2.0
"""A camera moved along its x axis by a little: each pixel looks up by its own depth. Scene and dots stay where they
are."""

import numpy as np

from activestereo.effects.core.light import Light
from activestereo.effects.core.resample import sample
from activestereo.effects.core.view import View

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
