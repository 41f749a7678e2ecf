# SPDX-License-Identifier: Apache-2.0
"""Dots that differ in strength from the nominal pattern."""

import numpy as np
from scipy.ndimage import gaussian_filter

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


def _gain(rng: np.random.Generator, shape: tuple[int, ...], spread: float, dot_px: float) -> np.ndarray:
    """Log-normal gains over the pattern, mean 1, of standard deviation `spread`."""
    smooth = gaussian_filter(rng.standard_normal(shape), dot_px, mode="wrap")
    width = np.sqrt(np.log1p(spread**2))
    return np.exp(width * smooth / smooth.std() - 0.5 * width**2)


@moves("pattern")
def _engine(inputs: EngineInputs, spread: float, dot_px: float) -> None:
    if spread > 0.0 and inputs.pattern is not None:
        inputs.pattern = inputs.pattern * _gain(inputs.rng("dot_gain_spread"), inputs.pattern.shape, spread, dot_px)


@effect(
    "dot_gain_spread",
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
    engine=_engine,
)
def dot_gain_spread(light: Light, view: View, spread: float, dot_px: float) -> Light:
    """Each dot has its own gain (log-normal, mean 1) that stays with it in every frame and both cameras."""
    if spread == 0.0:
        return light
    dots = DotView.of(view)
    gain = _gain(view.rng("dot_gain_spread", per="rig"), view.pattern.shape, spread, dot_px)
    return dots.change(light, dots.nominal(), dots.mean(view.pattern * gain))
