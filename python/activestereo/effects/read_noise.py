# SPDX-License-Identifier: Apache-2.0
"""Simulates read noise."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "read_noise",
    moves=("signal.read_noise_e",),
    stage=Stage.READOUT,
    family="temporal noise",
    finding="There is more noise of the amplifier than the model has",
    source="EMVA 1288; 0.2-1 DN on D4xx",
    randomness=Randomness.TEMPORAL,
    judged=(RandomTerm("sigma_dn", Lever.ONE),),
    parameters=[Parameter("sigma_dn", "DN", neutral=0.0, low=0.0, high=20.0, typical=0.8)],
)
def read_noise(inputs: EngineInputs, sigma_dn: float) -> None:
    """The amplifier adds noise that no light changes."""
    for side in inputs.sides:
        side.add_variance("read_noise_e", side.electrons(sigma_dn))
