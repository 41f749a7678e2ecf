# SPDX-License-Identifier: Apache-2.0
"""Simulates a response to light that is not linear."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "response_gamma",
    moves=("signal.response_exponent",),
    stage=Stage.READOUT,
    family="tone",
    finding="The camera's response to light is not linear",
    source="power-law camera response (Mitsunaga and Nayar 1999 treat the general case)",
    parameters=[
        Parameter(
            "log_exponent", "1", neutral=0.0, low=-1.0, high=1.0, typical=0.15,
            source="natural logarithm of the exponent",
        )
    ],
    is_pointwise=True,
)  # fmt: skip
def response_gamma(inputs: EngineInputs, log_exponent: float) -> None:
    """The output is proportional to light^exp(log_exponent); full scale is unchanged, and the black level is added
    afterwards."""
    for side in inputs.sides:
        side.signal["response_exponent"] *= np.exp(log_exponent)
