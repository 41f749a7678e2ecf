# SPDX-License-Identifier: Apache-2.0
"""Simulates camera blur: defocus and aberrations beyond the pixel's own square."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "lens_psf",
    moves=("optics.psf_sigma_px", "optics.psf_corner_sigma_px"),
    stage=Stage.CAMERA,
    family="camera blur",
    finding="The camera's lens blurs the images",
    source="Gaussian line spread; visible dot sigma 0.8-1.2 px on D4xx frames",
    parameters=[
        Parameter("sigma_px", "px", neutral=0.0, low=0.0, high=3.0, typical=0.5),
        Parameter(
            "corner_sigma_px", "px", neutral=0.0, low=0.0, high=4.0, typical=0.6,
            source="field curvature: grows with radius squared",
        ),
    ],
)  # fmt: skip
def lens_psf(inputs: EngineInputs, sigma_px: float, corner_sigma_px: float) -> None:
    """Gaussian blur of all light, constant over the image plus a part that grows towards the corners."""
    for side in inputs.sides:
        side.optics.psf_sigma_px = np.hypot(side.optics.psf_sigma_px, sigma_px)
        side.optics.psf_corner_sigma_px = np.hypot(side.optics.psf_corner_sigma_px, corner_sigma_px)
