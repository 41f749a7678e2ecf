# SPDX-License-Identifier: Apache-2.0
"""Simulates one camera out of focus."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "focus_mismatch",
    moves=("left.optics.psf_sigma_px", "right.optics.psf_sigma_px"),
    stage=Stage.CAMERA,
    family="camera blur",
    finding="One camera is out of focus",
    source="lenses of a pair are focused one by one; a knock or warmth moves one of them",
    parameters=[
        Parameter(
            "sigma_px", "px", neutral=0.0, low=-3.0, high=3.0, typical=0.4, source="> 0: of the right camera, < 0: left"
        )
    ],
)
def focus_mismatch(inputs: EngineInputs, sigma_px: float) -> None:
    """A Gaussian blur of one camera's images alone."""
    side = inputs.right if sigma_px > 0 else inputs.left
    side.optics.psf_sigma_px = np.hypot(side.optics.psf_sigma_px, sigma_px)
