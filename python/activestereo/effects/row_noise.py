# SPDX-License-Identifier: Apache-2.0
"""Noise that whole rows share."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.view import View


def _variance(signal: np.ndarray, view: View, sigma_dn: float) -> np.ndarray:
    return np.full(signal.shape, sigma_dn**2)


@moves("signal.row_noise_e")
def _engine(inputs: EngineInputs, sigma_dn: float) -> None:
    for side in inputs.sides:
        side.add_variance("row_noise_e", side.electrons(sigma_dn))


@effect(
    "row_noise",
    stage=Stage.READOUT,
    family="temporal noise",
    finding="Every row of every frame has an offset of its own",
    source="row-wise reference sampling of CMOS imagers; <= 0.03 DN on D4xx",
    randomness=Randomness.TEMPORAL,
    variance=_variance,
    judged=(RandomTerm("sigma_dn", Lever.ONE, SharedBy.ROW),),
    parameters=[Parameter("sigma_dn", "DN", neutral=0.0, low=0.0, high=10.0, typical=0.3)],
    engine=_engine,
)
def row_noise(signal: np.ndarray, view: View, sigma_dn: float) -> np.ndarray:
    """Every row of every frame has an offset of its own."""
    return signal + sigma_dn * view.rng("row_noise", per="frame").standard_normal((signal.shape[0], 1))
