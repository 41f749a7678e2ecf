# SPDX-License-Identifier: Apache-2.0
"""Pixels of unequal sensitivity."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.view import View


def _variance(signal: np.ndarray, view: View, sigma: float) -> np.ndarray:
    return (sigma * np.asarray(signal)) ** 2


@moves("signal.prnu")
def _engine(inputs: EngineInputs, sigma: float) -> None:
    for side in inputs.sides:
        side.add_variance("prnu", sigma)


@effect(
    "prnu",
    stage=Stage.CHARGE,
    family="fixed pattern",
    finding="Every pixel has a gain of its own",
    source="EMVA 1288 photo response non-uniformity, 0.5-2 %",
    randomness=Randomness.STATIC,
    variance=_variance,
    judged=(RandomTerm("sigma", Lever.SIGNAL),),
    parameters=[Parameter("sigma", "1", neutral=0.0, low=0.0, high=0.5, typical=0.01)],
    engine=_engine,
)
def prnu(signal: np.ndarray, view: View, sigma: float) -> np.ndarray:
    """Every pixel has its own gain, the same in all frames."""
    return signal * (1.0 + sigma * view.rng("prnu").standard_normal(signal.shape))
