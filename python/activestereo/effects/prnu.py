# SPDX-License-Identifier: Apache-2.0
"""Simulates pixels of unequal sensitivity."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "prnu",
    moves=("signal.prnu",),
    stage=Stage.CHARGE,
    family="fixed pattern",
    finding="Every pixel has a gain of its own",
    source="EMVA 1288 photo response non-uniformity, 0.5-2 %",
    randomness=Randomness.STATIC,
    judged=(RandomTerm("sigma", Lever.SIGNAL),),
    parameters=[Parameter("sigma", "1", neutral=0.0, low=0.0, high=0.5, typical=0.01)],
)
def prnu(inputs: EngineInputs, sigma: float) -> None:
    """Every pixel has its own gain, the same in all frames."""
    for side in inputs.sides:
        side.add_variance("prnu", sigma)
