# SPDX-License-Identifier: Apache-2.0
"""Simulates noise that whole rows share."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "row_noise",
    moves=("signal.row_noise_e",),
    stage=Stage.READOUT,
    family="temporal noise",
    finding="Every row of every frame has an offset of its own",
    source="row-wise reference sampling of CMOS imagers; <= 0.03 DN on D4xx",
    randomness=Randomness.TEMPORAL,
    judged=(RandomTerm("sigma_dn", Lever.ONE, SharedBy.ROW),),
    parameters=[Parameter("sigma_dn", "DN", neutral=0.0, low=0.0, high=10.0, typical=0.3)],
)
def row_noise(inputs: EngineInputs, sigma_dn: float) -> None:
    """Every row of every frame has an offset of its own."""
    for side in inputs.sides:
        side.add_variance("row_noise_e", side.electrons(sigma_dn))
