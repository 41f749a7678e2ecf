# SPDX-License-Identifier: Apache-2.0
"""Response that is not linear."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.view import View


@moves("signal.response_exponent")
def _engine(inputs: EngineInputs, log_exponent: float) -> None:
    for side in inputs.sides:
        side.signal["response_exponent"] *= np.exp(log_exponent)


@effect(
    "response_gamma",
    stage=Stage.READOUT,
    family="tone",
    finding="The camera's response to light is not linear",
    source="power-law camera response (Mitsunaga and Nayar 1999 treat the general case)",
    parameters=[
        Parameter(
            "log_exponent",
            "1",
            neutral=0.0,
            low=-1.0,
            high=1.0,
            typical=0.15,
            source="natural logarithm of the exponent",
        )
    ],
    engine=_engine,
    is_pointwise=True,
)
def response_gamma(signal: np.ndarray, view: View, log_exponent: float) -> np.ndarray:
    """The output is proportional to light^exp(log_exponent); full scale is unchanged, and the black level is added
    afterwards."""
    if log_exponent == 0.0:
        return signal
    relative = np.maximum(signal, 0.0) / view.max_dn
    return view.max_dn * relative ** np.exp(log_exponent)
