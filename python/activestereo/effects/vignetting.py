# SPDX-License-Identifier: Apache-2.0
"""Lens vignetting: the camera sees less light towards its corners."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.view import View


@moves("optics.vignetting_exponent")
def _engine(inputs: EngineInputs, exponent: float) -> None:
    for side in inputs.sides:
        side.optics.vignetting_exponent += exponent


@effect(
    "vignetting",
    stage=Stage.OPTICS,
    family="lens shading",
    finding="The images are darker towards their corners",
    source="cos^4 law of a thin lens: Born and Wolf, Principles of Optics, 4.8.1",
    parameters=[
        Parameter(
            "exponent", "1", neutral=0.0, low=0.0, high=8.0, typical=1.5, source="4 = thin lens; D4xx corners 0.35-0.45"
        )
    ],
    engine=_engine,
)
def vignetting(image: np.ndarray, view: View, exponent: float) -> np.ndarray:
    """All light falls by cos^exponent of the angle to the optical axis."""
    x, y = view.rays()
    return image * (1.0 + x * x + y * y) ** (-exponent / 2.0)
