# SPDX-License-Identifier: Apache-2.0
"""Dark current."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.view import View


@moves("signal.dark_current_e_per_s", "signal.dark_doubling_k")
def _engine(inputs: EngineInputs, rate_dn_per_s: float, doubling_k: float) -> None:
    for side in inputs.sides:
        side.signal["dark_current_e_per_s"] += rate_dn_per_s / side.signal["conversion_gain_dn_per_e"]
        side.signal["dark_doubling_k"] = doubling_k


@effect(
    "dark_signal",
    stage=Stage.CHARGE,
    family="dark",
    finding="Charge gathers without light",
    source="EMVA 1288; dark current of silicon doubles every 6-8 K",
    parameters=[
        Parameter(
            "rate_dn_per_s", "DN/s", neutral=0.0, low=0.0, high=5000.0, typical=100.0, source="at 25 C and gain 1"
        ),
        Parameter("doubling_k", "K", neutral=7.0, low=4.0, high=12.0, typical=1.0),
    ],
    engine=_engine,
)
def dark_signal(signal: np.ndarray, view: View, rate_dn_per_s: float, doubling_k: float) -> np.ndarray:
    """Charge gathers without light: in proportion to exposure, and twice as fast every doubling_k kelvins."""
    return signal + rate_dn_per_s * view.frame.exposure_gain * 2.0 ** (view.warming_k / doubling_k)
