# SPDX-License-Identifier: Apache-2.0
"""Lens distortion that the nominal calibration lacks."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@moves("camera.distortion")
def _engine(inputs: EngineInputs, k1: float, k2: float) -> None:
    for side in inputs.sides:
        side.add_distortion(k1, k2)


@effect(
    "radial_distortion",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The lenses distort more or less than calibrated",
    source="Brown 1966, Decentering distortion of lenses; OpenCV's k1, k2",
    parameters=[
        Parameter("k1", "1", neutral=0.0, low=-0.3, high=0.3, typical=0.01),
        Parameter("k2", "1", neutral=0.0, low=-0.1, high=0.1, typical=0.005),
    ],
    engine=_engine,
)
def radial_distortion(light: Light, view: View, k1: float, k2: float) -> Light:
    """Straight lines bend: image radius r is drawn at r (1 + k1 r^2 + k2 r^4), r in focal lengths, in both cameras."""
    if k1 == 0.0 and k2 == 0.0:
        return light
    return light.warped(*view.through_lens((k1, k2, 0.0, 0.0, 0.0)))
