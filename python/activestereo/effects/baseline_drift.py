# SPDX-License-Identifier: Apache-2.0
"""Baseline off its calibration."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.motion import shifted
from activestereo.effects.core.view import View


@moves("right.camera.camera_to_world")
def _engine(inputs: EngineInputs, offset_m: float) -> None:
    inputs.right.move(offset_m)


@effect(
    "baseline_drift",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The baseline is another one than calibrated",
    source="scale errors of f x baseline of 0.6 % (D435) and 1.2 % (D415) found in public data",
    parameters=[Parameter("offset_m", "m", neutral=0.0, low=-0.005, high=0.005, typical=0.0003)],
    engine=_engine,
)
def baseline_drift(light: Light, view: View, offset_m: float) -> Light:
    """The right camera stands offset_m further right: disparity grows in proportion to itself."""
    return shifted(light, view, offset_m) if view.is_right else light
