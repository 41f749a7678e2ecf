# SPDX-License-Identifier: Apache-2.0
"""Simulates a calibration that drifts with temperature."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "thermal_drift",
    moves=("camera.k",),
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The cameras' geometry drifts with temperature",
    source="D415/D455 at 1.7 m: 5 mm between 28 and 35 C (librealsense issue 8434)",
    parameters=[
        Parameter("cx_px_per_k", "px/K", neutral=0.0, low=-0.1, high=0.1, typical=0.005),
        Parameter("focal_per_k", "1/K", neutral=0.0, low=-1e-3, high=1e-3, typical=2e-5),
    ],
)
def thermal_drift(inputs: EngineInputs, cx_px_per_k: float, focal_per_k: float) -> None:
    """Per kelvin above 25 C the right image shifts and both images grow about their principal points."""
    inputs.right.shift_image(cx_px_per_k * inputs.warming_k, 0.0)
    for side in inputs.sides:
        side.scale_focal(1.0 + focal_per_k * inputs.warming_k)
