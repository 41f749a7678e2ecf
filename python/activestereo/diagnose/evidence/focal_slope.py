# SPDX-License-Identifier: Apache-2.0
"""The derivative of an image by the focal length, a nuisance since calibrations err.

It is a central difference of the supersampled images where there are any: a dot is hardly wider than a pixel, and
differences of pixels are wrong by half there. With a wrong derivative the fit would leave an error of the focal length
to an effect that also stretches the image.
"""

from dataclasses import replace

import numpy as np

from activestereo.compare.nuisances import Nuisances
from activestereo.diagnose.evidence.measured_image import MeasuredImage
from activestereo.effects import Light, Model

# A relative change of the focal length: a fifth of a pixel at the border of a small image.
_STEP = 2e-3


def focal_slope(measured_image: MeasuredImage, nuisances: Nuisances) -> np.ndarray:
    """DN per relative change of the focal length, float32 [height][width]."""
    model, (u, v), (cx, cy) = Model(), measured_image.view.pixels(), measured_image.view.K[:2, 2]
    light = _on_its_own(model.light(measured_image.layers, measured_image.view))

    def signal(change: float) -> np.ndarray:
        shorter = 1.0 / (1.0 + change)
        return model.signal(
            light.warped(cx + (u - cx) * shorter, cy + (v - cy) * shorter), measured_image.view, nuisances
        )

    return ((signal(_STEP) - signal(-_STEP)) / (2.0 * _STEP)).astype(np.float32)


def _on_its_own(light: Light) -> Light:
    """A copy of the light that shares no spline coefficients with others, which are as large as the images."""
    return light if light.fine is None else replace(light, fine=replace(light.fine))
