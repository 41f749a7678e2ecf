# SPDX-License-Identifier: Apache-2.0
"""Row-wise readout of a moving sensor."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.motion import displaced
from activestereo.effects.core.view import View


@moves("camera.shutter", "camera.line_time_s", "camera.readout")
def _engine(inputs: EngineInputs, line_time_s: float) -> None:
    for side in inputs.sides:
        side.camera.shutter = "rolling"
        side.camera.line_time_s = abs(line_time_s)
        side.camera.readout = "rows_down" if line_time_s > 0 else "rows_up"


@effect(
    "rolling_shutter",
    stage=Stage.CAMERA,
    family="motion",
    finding="Rows are exposed one after the other",
    source="Meingast, Geyer and Sastry 2005, Geometric models of rolling-shutter cameras",
    parameters=[
        Parameter(
            "line_time_s", "s", neutral=0.0, low=-1e-4, high=1e-4, typical=2e-5, source="10-70 us on common imagers"
        )
    ],
    engine=_engine,
)
def rolling_shutter(light: Light, view: View, line_time_s: float) -> Light:
    """Rows are exposed one after the other, the middle row at the frame's time."""
    height = view.shape[0]
    return displaced(light, view, (np.arange(height) - (height - 1) / 2) * line_time_s)
