# SPDX-License-Identifier: Apache-2.0
"""Simulates a projector that is dimmer off its axis."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "projector_vignetting",
    moves=("pattern",),
    stage=Stage.PROJECTOR,
    family="projector shading",
    finding="The projector is darker towards its edges",
    source="radiant intensity of a collimated diffractive projector falls with a power of cos",
    parameters=[Parameter("exponent", "1", neutral=0.0, low=0.0, high=12.0, typical=1.5)],
)
def projector_vignetting(inputs: EngineInputs, exponent: float) -> None:
    """Projected light falls by cos^exponent of the angle to the projector's axis; ambient light does not."""
    if inputs.pattern is None and inputs.projector is not None:
        inputs.projector.falloff += exponent
    elif exponent != 0.0:  # kuafu's own falloff needs its slower shading of shaped lights
        inputs.dim_pattern(lambda x, y: (1.0 + x * x + y * y) ** (-0.5 * exponent))
