# SPDX-License-Identifier: Apache-2.0
"""Right camera pitched against the left."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.motion import turned
from activestereo.effects.core.view import View


@moves("right.camera.camera_to_world")
def _engine(inputs: EngineInputs, angle_rad: float) -> None:
    inputs.right.turn((1.0, 0.0, 0.0), angle_rad)


@effect(
    "stereo_pitch",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The right camera is pitched against its calibration",
    source="vertical disparity 0.02-0.3 px on real D4xx pairs",
    parameters=[Parameter("angle_rad", "rad", neutral=0.0, low=-0.02, high=0.02, typical=0.0005)],
    engine=_engine,
)
def stereo_pitch(light: Light, view: View, angle_rad: float) -> Light:
    """The right camera is turned about its x axis: rows of the pair no longer meet."""
    return turned(light, view, (1.0, 0.0, 0.0), angle_rad) if view.is_right else light
