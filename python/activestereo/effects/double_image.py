# SPDX-License-Identifier: Apache-2.0
"""Pane whose second reflection doubles the image."""

import numpy as np
from scipy.ndimage import shift

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.view import View


@effect(
    "double_image",
    stage=Stage.OPTICS,
    family="glare",
    finding="A pane before the cameras doubles the images",
    source="Fresnel: light that both faces of a pane reflect leaves it 0.2 % (glass) to 10 % (coated) as bright, aside "
    "by twice the angle of its wedge",
    parameters=[
        Parameter("fraction", "1", neutral=0.0, low=0.0, high=0.5, typical=0.03),
        Parameter("shift_u_px", "px", neutral=3.0, low=-20.0, high=20.0, typical=3.0, source="aside of the image"),
        Parameter("shift_v_px", "px", neutral=0.0, low=-20.0, high=20.0, typical=3.0, source="below the image"),
    ],
    image_only="kuafu's optics end at the lens",
)
def double_image(image: np.ndarray, view: View, fraction: float, shift_u_px: float, shift_v_px: float) -> np.ndarray:
    """A weaker image lies beside the image."""
    if fraction == 0.0:
        return image
    return image + fraction * shift(image, (*(0,) * (image.ndim - 2), shift_v_px, shift_u_px), order=1)
