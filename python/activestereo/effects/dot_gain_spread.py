# SPDX-License-Identifier: Apache-2.0
"""Simulates dots that differ in strength from the nominal pattern."""

import numpy as np
from scipy.ndimage import gaussian_filter

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "dot_gain_spread",
    moves=("pattern",),
    stage=Stage.PROJECTOR,
    family="pattern strength",
    finding="The projector's dots differ in brightness",
    source="coefficient of variation 0.4-0.5 over visible dots of D4xx, falloff included",
    randomness=Randomness.STATIC,
    judged=(RandomTerm("spread", Lever.PROJECTOR, SharedBy.DOT),),
    parameters=[
        Parameter("spread", "1", neutral=0.0, low=0.0, high=0.8, typical=0.15),
        Parameter(
            "dot_px", "px", neutral=3.0, low=1.0, high=20.0, typical=2.0, source="size of a dot in pattern pixels"
        ),
    ],
)
def dot_gain_spread(inputs: EngineInputs, spread: float, dot_px: float) -> None:
    """Each dot has its own gain (log-normal, mean 1) that stays with it in every frame and both cameras."""
    if spread > 0.0 and inputs.pattern is not None:
        draws = inputs.rng("dot_gain_spread").standard_normal(inputs.pattern.shape)
        smooth, width = gaussian_filter(draws, dot_px, mode="wrap"), np.sqrt(np.log1p(spread**2))
        inputs.pattern = inputs.pattern * np.exp(width * smooth / smooth.std() - 0.5 * width**2)
