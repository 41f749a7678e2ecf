# SPDX-License-Identifier: Apache-2.0
"""Simulates a right camera that is rolled against the left."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "stereo_roll",
    moves=("right.camera.camera_to_world",),
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The right camera is rolled against its calibration",
    source="vertical disparity that changes over the image width on real D4xx pairs",
    parameters=[Parameter("angle_rad", "rad", neutral=0.0, low=-0.05, high=0.05, typical=0.001)],
)
def stereo_roll(inputs: EngineInputs, angle_rad: float) -> None:
    """The right camera is turned about its optical axis."""
    inputs.right.turn((0.0, 0.0, 1.0), angle_rad)
