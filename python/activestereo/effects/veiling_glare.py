# SPDX-License-Identifier: Apache-2.0
"""Veiling glare: light scattered in the lens falls on the whole image."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.view import View


@moves("optics.veiling_glare_fraction")
def _engine(inputs: EngineInputs, fraction: float) -> None:
    for side in inputs.sides:
        side.optics.veiling_glare_fraction = 1.0 - (1.0 - side.optics.veiling_glare_fraction) * (1.0 - fraction)


@effect(
    "veiling_glare",
    stage=Stage.OPTICS,
    family="glare",
    finding="Stray light veils the images",
    source="ISO 9358 veiling glare index",
    parameters=[Parameter("fraction", "1", neutral=0.0, low=0.0, high=0.5, typical=0.04)],
    engine=_engine,
)
def veiling_glare(image: np.ndarray, view: View, fraction: float) -> np.ndarray:
    """A fraction of all light is spread evenly over the image."""
    return (1.0 - fraction) * image + fraction * image.mean(axis=(-2, -1), keepdims=True)
