# SPDX-License-Identifier: Apache-2.0
"""Simulates lens vignetting: the camera sees less light towards its corners."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "vignetting",
    moves=("optics.vignetting_exponent",),
    stage=Stage.OPTICS,
    family="lens shading",
    finding="The images are darker towards their corners",
    source="cos^4 law of a thin lens: Born and Wolf, Principles of Optics, 4.8.1",
    parameters=[
        Parameter(
            "exponent", "1", neutral=0.0, low=0.0, high=8.0, typical=1.5, source="4 = thin lens; D4xx corners 0.35-0.45"
        )
    ],
)
def vignetting(inputs: EngineInputs, exponent: float) -> None:
    """All light falls by cos^exponent of the angle to the optical axis."""
    for side in inputs.sides:
        side.optics.vignetting_exponent += exponent
