# SPDX-License-Identifier: Apache-2.0
"""Simulates a black level that is shifted and drifts with temperature."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "black_level",
    moves=("signal.black_level_dn", "signal.black_level_dn_per_k"),
    stage=Stage.DIGITAL,
    family="dark",
    finding="The black level is another one than the model's",
    source="pedestals of 5 (D415) and 20 DN (D435) seen on public frames; drift with temperature and gain",
    parameters=[
        Parameter(
            "offset_dn", "DN", neutral=0.0, low=-50.0, high=50.0, typical=2.0,
            source="the fit's black level absorbs a constant one",
        ),
        Parameter("per_k_dn", "DN/K", neutral=0.0, low=-1.0, high=1.0, typical=0.05),
    ],
)  # fmt: skip
def black_level(inputs: EngineInputs, offset_dn: float, per_k_dn: float) -> None:
    """A pedestal that is there without light, and moves with temperature."""
    for side in inputs.sides:
        side.signal["black_level_dn"] += offset_dn
        side.signal["black_level_dn_per_k"] += per_k_dn
