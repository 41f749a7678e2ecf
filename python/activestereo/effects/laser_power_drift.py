# SPDX-License-Identifier: Apache-2.0
"""Laser power that drifts."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


def _power(warming: float, ageing: float) -> float:
    """Relative power after logarithmic drift with temperature and linear drift with time."""
    return float(np.exp(warming) * max(0.0, 1.0 + ageing))


@moves("projector.ir_intensity")
def _engine(inputs: EngineInputs, per_k: float, per_s: float) -> None:
    if inputs.projector is not None and inputs.projector.ir_intensity is not None:
        inputs.projector.ir_intensity *= _power(per_k * inputs.warming_k, per_s * inputs.frame.timestamp_s)


@effect(
    "laser_power_drift",
    stage=Stage.PROJECTOR,
    family="projector power",
    finding="The projector's power drifts",
    source="laser diodes lose 0.2-1 % of power per kelvin at constant current; firmware derates when hot (librealsense "
           "issue 10476)",
    parameters=[
        Parameter("per_k", "1/K", neutral=0.0, low=-0.03, high=0.03, typical=0.004),
        Parameter("per_s", "1/s", neutral=0.0, low=-0.02, high=0.02, typical=0.002),
    ],
    engine=_engine,
)
def laser_power_drift(light: Light, view: View, per_k: float, per_s: float) -> Light:
    """Projected light changes by the same factor, exp(per_k), with every kelvin above 25 C, and with the time since the
    capture began."""
    return light.scale_projector(_power(per_k * view.warming_k, per_s * view.frame.timestamp_s))
