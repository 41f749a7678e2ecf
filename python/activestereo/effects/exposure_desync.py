# SPDX-License-Identifier: Apache-2.0
"""Cameras that do not expose at the same time."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.motion import displaced
from activestereo.effects.core.view import View


@moves("right.delay_s")
def _engine(inputs: EngineInputs, delay_s: float) -> None:
    inputs.right.delay_s += delay_s


@effect(
    "exposure_desync",
    stage=Stage.CAMERA,
    family="motion",
    finding="The right camera exposes at another time than the left one",
    source="stereo pairs without hardware synchronisation: shift = f v dt / z",
    parameters=[Parameter("delay_s", "s", neutral=0.0, low=-0.02, high=0.02, typical=0.001)],
    engine=_engine,
)
def exposure_desync(light: Light, view: View, delay_s: float) -> Light:
    """The right camera exposes delay_s after the left; a disparity error that follows the rig's velocity."""
    return displaced(light, view, delay_s) if view.is_right else light
