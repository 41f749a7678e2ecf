# SPDX-License-Identifier: Apache-2.0
"""One camera out of focus."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@moves("left.optics.psf_sigma_px", "right.optics.psf_sigma_px")
def _engine(inputs: EngineInputs, sigma_px: float) -> None:
    side = inputs.right if sigma_px > 0 else inputs.left
    side.optics.psf_sigma_px = np.hypot(side.optics.psf_sigma_px, sigma_px)


@effect(
    "focus_mismatch",
    stage=Stage.CAMERA,
    family="camera blur",
    finding="One camera is out of focus",
    source="lenses of a pair are focused one by one; a knock or warmth moves one of them",
    parameters=[
        Parameter(
            "sigma_px", "px", neutral=0.0, low=-3.0, high=3.0, typical=0.4, source="> 0: of the right camera, < 0: left"
        )
    ],
    engine=_engine,
)
def focus_mismatch(light: Light, view: View, sigma_px: float) -> Light:
    """A Gaussian blur of one camera's images alone."""
    blurs = sigma_px > 0 if view.is_right else sigma_px < 0
    return light.blurred(abs(sigma_px)) if blurs else light
