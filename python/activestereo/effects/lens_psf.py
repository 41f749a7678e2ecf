# SPDX-License-Identifier: Apache-2.0
"""Camera blur: defocus and aberrations beyond the pixel's own square."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@moves("optics.psf_sigma_px", "optics.psf_corner_sigma_px")
def _engine(inputs: EngineInputs, sigma_px: float, corner_sigma_px: float) -> None:
    for side in inputs.sides:
        side.optics.psf_sigma_px = np.hypot(side.optics.psf_sigma_px, sigma_px)
        side.optics.psf_corner_sigma_px = np.hypot(side.optics.psf_corner_sigma_px, corner_sigma_px)


@effect(
    "lens_psf",
    stage=Stage.CAMERA,
    family="camera blur",
    finding="The camera's lens blurs the images",
    source="Gaussian line spread; visible dot sigma 0.8-1.2 px on D4xx frames",
    parameters=[
        Parameter("sigma_px", "px", neutral=0.0, low=0.0, high=3.0, typical=0.5),
        Parameter(
            "corner_sigma_px",
            "px",
            neutral=0.0,
            low=0.0,
            high=4.0,
            typical=0.6,
            source="field curvature: grows with radius squared",
        ),
    ],
    engine=_engine,
)
def lens_psf(light: Light, view: View, sigma_px: float, corner_sigma_px: float) -> Light:
    """Gaussian blur of all light, constant over the image plus a part that grows towards the corners."""
    if corner_sigma_px == 0.0:
        return light.blurred(sigma_px) if sigma_px else light
    fx, fy = view.field()
    corner = corner_sigma_px * (fx * fx + fy * fy) / 2.0
    return light.blurred((sigma_px**2 + corner**2) ** 0.5)
