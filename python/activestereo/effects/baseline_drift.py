# SPDX-License-Identifier: Apache-2.0
"""Simulates a baseline that differs from its calibration."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "baseline_drift",
    moves=("right.camera.camera_to_world",),
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The baseline is another one than calibrated",
    source="scale errors of f x baseline of 0.6 % (D435) and 1.2 % (D415) found in public data",
    parameters=[Parameter("offset_m", "m", neutral=0.0, low=-0.005, high=0.005, typical=0.0003)],
)
def baseline_drift(inputs: EngineInputs, offset_m: float) -> None:
    """The right camera stands offset_m further right: disparity grows in proportion to itself."""
    inputs.right.move(offset_m)
