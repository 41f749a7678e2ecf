# SPDX-License-Identifier: Apache-2.0
"""Simulates full wells that overflow into neighbouring pixels."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "saturation_blooming",
    moves=("signal.full_well_e", "signal.blooming"),
    stage=Stage.CHARGE,
    family="saturation",
    finding="Bright pixels saturate early and spill into their neighbours",
    source="Janesick, Photon Transfer, full well and blooming",
    parameters=[
        Parameter(
            "lost_range", "1", neutral=0.0, low=0.0, high=0.95, typical=0.3,
            source="the well is full at (1 - this) of the range",
        ),
        Parameter(
            "spill", "1", neutral=0.0, low=0.0, high=1.0, typical=0.3,
            source="share of the overflow that reaches the column's neighbours",
        ),
    ],
)  # fmt: skip
def saturation_blooming(inputs: EngineInputs, lost_range: float, spill: float) -> None:
    """Pixels stop counting before the range ends, and spill into the pixels above and below."""
    if lost_range > 0.0:
        for side in inputs.sides:
            side.signal["full_well_e"] = side.electrons((1.0 - lost_range) * inputs.max_dn)
            side.signal["blooming"] = spill
