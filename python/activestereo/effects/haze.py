# SPDX-License-Identifier: Apache-2.0
"""Simulates a participating medium between rig and scene."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect

# Henyey and Greenstein's phase function always scatters some light back, so g is limited.
_MOST_FORWARD = 0.98


def _phase_g(backscatter: float) -> float:
    """Returns the g of Henyey and Greenstein's phase function that sends `backscatter` times the isotropic share
    straight back: (1 - g) / (1 + g)^2."""
    if backscatter == 0.0:
        return _MOST_FORWARD
    root = np.sqrt(8.0 * backscatter + 1.0)
    return float(np.clip((root - 2.0 * backscatter - 1.0) / (2.0 * backscatter), -_MOST_FORWARD, _MOST_FORWARD))


@engine_effect(
    "haze",
    moves=("medium",),
    stage=Stage.MEDIUM,
    family="medium",
    finding="The air in front of the camera is hazy",
    source="Koschmieder 1924; single scattering of uniform ambient light and of the projector's own beam",
    parameters=[
        Parameter("extinction_per_m", "1/m", neutral=0.0, low=0.0, high=3.0, typical=0.1),
        Parameter(
            "backscatter", "1", neutral=1.0, low=0.0, high=3.0, typical=0.5,
            source="scattering back to the rig over isotropic: fine smoke 1, fog 0.1-0.5 (Henyey and Greenstein 1941)",
        ),
        Parameter(
            "housing_m", "m", neutral=0.05, low=0.01, high=0.3, typical=0.03,
            source="window and housing of the camera keep the air out so far, where the beam is brightest",
        ),
    ],
)  # fmt: skip
def haze(inputs: EngineInputs, extinction_per_m: float, backscatter: float, housing_m: float) -> None:
    """Light is attenuated by exp(-extinction x distance). The air scatters ambient light and the projector's beam into
    the camera."""
    if extinction_per_m > 0.0:
        lower, upper = inputs.bounds_m
        inputs.fill_with(
            extinction_per_m=(extinction_per_m,) * 3,
            albedo=(1.0,) * 3,
            phase_g=_phase_g(backscatter),
            bounds_min_m=lower,
            bounds_max_m=upper,
            housing_m=housing_m,
        )
