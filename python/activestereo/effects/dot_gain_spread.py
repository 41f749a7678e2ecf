"""Dots that differ in strength from the nominal pattern."""

import numpy as np
from scipy.ndimage import gaussian_filter

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.dots import DotView


def _gain_field(view, correlation_px):
    """Zero-mean, unit-deviation random field over the pattern, the same for both eyes."""
    field = view.rng("dot_gain_spread", per="rig").standard_normal(view.pattern.shape)
    smooth = gaussian_filter(field, correlation_px, mode="wrap")
    return smooth / smooth.std()


@effect(
    "dot_gain_spread",
    stage=Stage.PROJECTOR,
    family="pattern strength",
    source="coefficient of variation 0.4-0.5 over visible dots of D4xx, falloff included",
    randomness=Randomness.STATIC,
    parameters=[
        Parameter("spread", "1", neutral=0.0, low=0.0, high=0.8, typical=0.15),
        Parameter("dot_px", "px", neutral=3.0, low=1.0, high=20.0, typical=2.0, source="size of a dot in pattern pixels"),
    ],
)
def dot_gain_spread(light, view, spread, dot_px):
    """Each dot has its own gain (log-normal, mean 1) that stays with it in every frame and both eyes."""
    if spread == 0.0:
        return light
    width = np.sqrt(np.log1p(spread**2))
    gain = np.exp(width * _gain_field(view, dot_px) - 0.5 * width**2)
    dots = DotView.of(view)
    return dots.change(light, dots.nominal, dots.mean(view.pattern * gain))
