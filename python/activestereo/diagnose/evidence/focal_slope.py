# SPDX-License-Identifier: Apache-2.0
"""The change of an image by a calibration's error of the focal length.

It is the difference over both sides of the finer images where there are any: a dot is hardly wider than a pixel, and
pixels alone tell the slope beside it wrong by half. A slope that is wrong leaves most of the error to an effect that
also stretches the picture.
"""

from dataclasses import replace

import numpy as np

from activestereo.compare.nuisances import Nuisances
from activestereo.diagnose.evidence.measured_image import MeasuredImage
from activestereo.effects import Light, Model

# A relative change of the focal length: a fifth of a pixel at the border of a small image.
_STEP = 2e-3


def focal_slope(shot: MeasuredImage, nuisances: Nuisances) -> np.ndarray:
    """DN per relative change of the focal length, float32 [height][width]."""
    model, (u, v), (cx, cy) = Model(), shot.view.pixels(), shot.view.K[:2, 2]
    light = _on_its_own(model.light(shot.layers, shot.view))

    def signal(change: float) -> np.ndarray:
        shorter = 1.0 / (1.0 + change)
        return model.signal(light.warped(cx + (u - cx) * shorter, cy + (v - cy) * shorter), shot.view, nuisances)

    return ((signal(_STEP) - signal(-_STEP)) / (2.0 * _STEP)).astype(np.float32)


def _on_its_own(light: Light) -> Light:
    """The light, whose finer images keep no splines for others: those are as large as the images."""
    return light if light.fine is None else replace(light, fine=replace(light.fine))
