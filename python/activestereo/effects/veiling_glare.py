# SPDX-License-Identifier: Apache-2.0
"""Simulates veiling glare: light scattered in the lens falls on the whole image."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "veiling_glare",
    moves=("optics.veiling_glare_fraction",),
    stage=Stage.OPTICS,
    family="glare",
    finding="Stray light veils the images",
    source="ISO 9358 veiling glare index",
    parameters=[Parameter("fraction", "1", neutral=0.0, low=0.0, high=0.8, typical=0.04)],
)
def veiling_glare(inputs: EngineInputs, fraction: float) -> None:
    """A fraction of all light is spread evenly over the image."""
    for side in inputs.sides:
        side.optics.veiling_glare_fraction = 1.0 - (1.0 - side.optics.veiling_glare_fraction) * (1.0 - fraction)
