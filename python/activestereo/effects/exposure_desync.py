# SPDX-License-Identifier: Apache-2.0
"""Simulates cameras that do not expose at the same time."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "exposure_desync",
    moves=("right.delay_s",),
    stage=Stage.CAMERA,
    family="motion",
    finding="The right camera exposes at another time than the left one",
    source="stereo pairs without hardware synchronisation: shift = f v dt / z",
    parameters=[Parameter("delay_s", "s", neutral=0.0, low=-0.02, high=0.02, typical=0.001)],
)
def exposure_desync(inputs: EngineInputs, delay_s: float) -> None:
    """The right camera exposes delay_s after the left; a disparity error that follows the rig's velocity."""
    inputs.right.delay_s += delay_s
