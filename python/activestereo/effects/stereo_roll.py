# SPDX-License-Identifier: Apache-2.0
"""Right camera rolled against the left."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.motion import turned
from activestereo.effects.core.view import View


@moves("right.camera.camera_to_world")
def _engine(inputs: EngineInputs, angle_rad: float) -> None:
    inputs.right.turn((0.0, 0.0, 1.0), angle_rad)


@effect(
    "stereo_roll",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The right camera is rolled against its calibration",
    source="vertical disparity that changes over the image width on real D4xx pairs",
    parameters=[Parameter("angle_rad", "rad", neutral=0.0, low=-0.05, high=0.05, typical=0.001)],
    engine=_engine,
)
def stereo_roll(light: Light, view: View, angle_rad: float) -> Light:
    """The right camera is turned about its optical axis."""
    return turned(light, view, (0.0, 0.0, 1.0), angle_rad) if view.is_right else light
