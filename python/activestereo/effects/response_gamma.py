"""Response that is not linear."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect


@effect(
    "response_gamma",
    stage=Stage.READOUT,
    family="tone",
    source="power-law camera response (Mitsunaga and Nayar 1999 treat the general case)",
    parameters=[Parameter("log_exponent", "1", neutral=0.0, low=-1.0, high=1.0, typical=0.15, source="natural logarithm of the exponent")],
)
def response_gamma(signal, view, log_exponent):
    """Output goes with a power of the light, exp(log_exponent), full scale fixed; the black level is added after."""
    if log_exponent == 0.0:
        return signal
    relative = np.maximum(signal, 0.0) / view.max_dn
    return view.max_dn * relative ** np.exp(log_exponent)
