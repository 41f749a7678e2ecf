# SPDX-License-Identifier: Apache-2.0
"""The derivative of an image by the focal length, a nuisance since calibrations err.

It is a central difference of the supersampled images where there are any: a dot is hardly wider than a pixel, and
differences of pixels are wrong by half there. With a wrong derivative the fit would leave an error of the focal length
to an effect that also stretches the image.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import ImageKey
from activestereo.compare.nuisances import Nuisances
from activestereo.diagnose.evidence.measured_image import MeasuredImage, derivatives_in_dn
from activestereo.effects import Light

# A relative change of the focal length: a fifth of a pixel at the border of a small image.
_STEP = 2e-3


def focal_slopes(images: Sequence[MeasuredImage], nuisances: Nuisances) -> dict[ImageKey, NDArray[np.float32]]:
    """{(frame id, side): DN per relative change of the focal length [height][width]}."""
    return derivatives_in_dn(images, nuisances, _of_light)


def _of_light(image: MeasuredImage) -> NDArray[np.float32]:
    """Derivatives of the projector's light and of the ambient light, [2][height][width]."""
    (u, v), (cx, cy) = image.view.pixels(), image.view.K[:2, 2]
    light = _on_its_own(Light.of(image.layers))

    def seen(change: float) -> NDArray[np.float64]:
        shorter = 1.0 / (1.0 + change)
        moved = light.warped(cx + (u - cx) * shorter, cy + (v - cy) * shorter)
        return np.stack([moved.projector, moved.ambient])

    return ((seen(_STEP) - seen(-_STEP)) / (2.0 * _STEP)).astype(np.float32)


def _on_its_own(light: Light) -> Light:
    """A copy of the light that shares no spline coefficients with others, which are as large as the images."""
    return light if light.supersampled is None else replace(light, supersampled=replace(light.supersampled))
