# SPDX-License-Identifier: Apache-2.0
"""Simulates a ghost: a reflection between imager and pane."""

import numpy as np
from scipy.ndimage import shift

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.view import View


@effect(
    "lens_ghost",
    stage=Stage.OPTICS,
    family="glare",
    finding="A pane before the cameras adds mirrored ghosts to the images",
    source="Fresnel: an uncoated face reflects 4 %, an imager 10 to 20 %; Hullin et al. 2011, Physically-based "
    "real-time lens flare rendering, section 3",
    parameters=[Parameter("fraction", "1", neutral=0.0, low=0.0, high=0.5, typical=0.02)],
    image_only="kuafu's optics end at the lens",
)
def lens_ghost(image: np.ndarray, view: View, fraction: float) -> np.ndarray:
    """A pane square to the axis sends the imager's reflection back: a ghost, point-mirrored at the principal point."""
    if fraction == 0.0:
        return image
    height, width = view.shape
    middle = 2.0 * view.K[1, 2] - (height - 1), 2.0 * view.K[0, 2] - (width - 1)
    return image + fraction * shift(image[..., ::-1, ::-1], (*(0,) * (image.ndim - 2), *middle), order=1)
