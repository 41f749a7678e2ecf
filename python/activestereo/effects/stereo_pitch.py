# SPDX-License-Identifier: Apache-2.0
"""Simulates a right camera that is pitched against the left."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "stereo_pitch",
    moves=("right.camera.camera_to_world",),
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The right camera is pitched against its calibration",
    source="vertical disparity 0.02-0.3 px on real D4xx pairs",
    parameters=[Parameter("angle_rad", "rad", neutral=0.0, low=-0.02, high=0.02, typical=0.0005)],
)
def stereo_pitch(inputs: EngineInputs, angle_rad: float) -> None:
    """The right camera is turned about its x axis: rows of the pair no longer meet."""
    inputs.right.turn((1.0, 0.0, 0.0), angle_rad)
