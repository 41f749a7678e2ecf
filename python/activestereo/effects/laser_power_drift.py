# SPDX-License-Identifier: Apache-2.0
"""Simulates laser power that drifts with temperature and time."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "laser_power_drift",
    moves=("projector.ir_intensity",),
    stage=Stage.PROJECTOR,
    family="projector power",
    finding="The projector's power drifts",
    source="laser diodes lose 0.2-1 % of power per kelvin at constant current; firmware derates when hot (librealsense "
    "issue 10476)",
    parameters=[
        Parameter("per_k", "1/K", neutral=0.0, low=-0.03, high=0.03, typical=0.004),
        Parameter("per_s", "1/s", neutral=0.0, low=-0.02, high=0.02, typical=0.002),
    ],
)
def laser_power_drift(inputs: EngineInputs, per_k: float, per_s: float) -> None:
    """Projected light changes by the same factor, exp(per_k), with every kelvin above 25 C, and with the time since the
    capture began."""
    if inputs.projector is not None and inputs.projector.ir_intensity is not None:
        aged = max(0.0, 1.0 + per_s * inputs.frame.timestamp_s)
        inputs.projector.ir_intensity *= float(np.exp(per_k * inputs.warming_k)) * aged
