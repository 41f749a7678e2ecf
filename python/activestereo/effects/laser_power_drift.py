"""Laser power that drifts."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect


@effect(
    "laser_power_drift",
    stage=Stage.PROJECTOR,
    family="projector power",
    source="laser diodes lose 0.2-1 % of power per kelvin at constant current; firmware derates when hot (librealsense issue 10476)",
    parameters=[
        Parameter("per_k", "1/K", neutral=0.0, low=-0.03, high=0.03, typical=0.004),
        Parameter("per_s", "1/s", neutral=0.0, low=-0.02, high=0.02, typical=0.002),
    ],
)
def laser_power_drift(light, view, per_k, per_s):
    """Projected light changes by the same factor, exp(per_k), with every kelvin above 25 C, and with the time since the capture began."""
    return light.scale_projector(np.exp(per_k * view.warming_k) * max(0.0, 1.0 + per_s * view.frame.timestamp_s))
