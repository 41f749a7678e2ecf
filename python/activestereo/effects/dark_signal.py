# SPDX-License-Identifier: Apache-2.0
"""Simulates dark current."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "dark_signal",
    moves=("signal.dark_current_e_per_s", "signal.dark_doubling_k"),
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
)
def dark_signal(inputs: EngineInputs, rate_dn_per_s: float, doubling_k: float) -> None:
    """Charge gathers without light: in proportion to exposure, and twice as fast every doubling_k kelvins."""
    for side in inputs.sides:
        side.signal["dark_current_e_per_s"] += rate_dn_per_s / side.signal["conversion_gain_dn_per_e"]
        side.signal["dark_doubling_k"] = doubling_k
