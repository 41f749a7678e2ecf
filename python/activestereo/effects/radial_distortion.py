# SPDX-License-Identifier: Apache-2.0
"""Simulates lens distortion that the nominal calibration lacks."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "radial_distortion",
    moves=("camera.distortion",),
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The lenses distort more or less than calibrated",
    source="Brown 1966, Decentering distortion of lenses; OpenCV's k1, k2",
    parameters=[
        Parameter("k1", "1", neutral=0.0, low=-0.3, high=0.3, typical=0.01),
        Parameter("k2", "1", neutral=0.0, low=-0.1, high=0.1, typical=0.005),
    ],
)
def radial_distortion(inputs: EngineInputs, k1: float, k2: float) -> None:
    """Straight lines bend: image radius r is drawn at r (1 + k1 r^2 + k2 r^4), r in focal lengths, in both cameras."""
    for side in inputs.sides:
        side.add_distortion(k1, k2)
