# SPDX-License-Identifier: Apache-2.0
"""Simulates the row-wise readout of a moving sensor."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "rolling_shutter",
    moves=("camera.shutter", "camera.line_time_s", "camera.readout"),
    stage=Stage.CAMERA,
    family="motion",
    finding="Rows are exposed one after the other",
    source="Meingast, Geyer and Sastry 2005, Geometric models of rolling-shutter cameras",
    parameters=[
        Parameter(
            "line_time_s", "s", neutral=0.0, low=-1e-4, high=1e-4, typical=2e-5, source="10-70 us on common imagers"
        )
    ],
)
def rolling_shutter(inputs: EngineInputs, line_time_s: float) -> None:
    """Rows are exposed one after the other, the middle row at the frame's time."""
    for side in inputs.sides:
        side.camera.shutter = "rolling"
        side.camera.line_time_s = abs(line_time_s)
        side.camera.readout = "rows_down" if line_time_s > 0 else "rows_up"
