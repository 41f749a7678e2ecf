# SPDX-License-Identifier: Apache-2.0
"""Motion during the exposure."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.motion import displaced
from activestereo.effects.core.view import View

_INSTANTS = 5


@moves("camera.exposure_s")
def _engine(inputs: EngineInputs, exposure_fraction: float) -> None:
    for side in inputs.sides:
        side.camera.exposure_s = exposure_fraction * inputs.frame.exposure_s


@effect(
    "motion_blur",
    stage=Stage.CAMERA,
    family="motion",
    finding="Motion blurs the images",
    source="exposure is an integral over time",
    parameters=[
        Parameter(
            "exposure_fraction",
            "1",
            neutral=0.0,
            low=0.0,
            high=2.0,
            typical=1.0,
            source="1 = the frame's own exposure time",
        )
    ],
    engine=_engine,
)
def motion_blur(light: Light, view: View, exposure_fraction: float) -> Light:
    """The image is the mean over the exposure of what the moving rig sees."""
    if exposure_fraction == 0.0 or not view.frame.is_moving:
        return light
    times = (np.arange(_INSTANTS) + 0.5) / _INSTANTS - 0.5
    seen = [displaced(light, view, t * exposure_fraction * view.frame.exposure_s) for t in times]
    return Light(
        *(sum(getattr(s, name) for s in seen) / _INSTANTS for name in ("direct", "indirect", "ambient", "flat"))
    )
