# SPDX-License-Identifier: Apache-2.0
"""Read noise."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.view import View


def _variance(signal: np.ndarray, view: View, sigma_dn: float) -> np.ndarray:
    return np.full(signal.shape, sigma_dn**2)


@moves("signal.read_noise_e")
def _engine(inputs: EngineInputs, sigma_dn: float) -> None:
    for side in inputs.sides:
        side.add_variance("read_noise_e", side.electrons(sigma_dn))


@effect(
    "read_noise",
    stage=Stage.READOUT,
    family="temporal noise",
    finding="There is more noise of the amplifier than the model has",
    source="EMVA 1288; 0.2-1 DN on D4xx",
    randomness=Randomness.TEMPORAL,
    variance=_variance,
    judged=(RandomTerm("sigma_dn", Lever.ONE),),
    parameters=[Parameter("sigma_dn", "DN", neutral=0.0, low=0.0, high=20.0, typical=0.8)],
    engine=_engine,
)
def read_noise(signal: np.ndarray, view: View, sigma_dn: float) -> np.ndarray:
    """The amplifier adds noise that no light changes."""
    return signal + sigma_dn * view.rng("read_noise", per="frame").standard_normal(signal.shape)
