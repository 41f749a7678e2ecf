# SPDX-License-Identifier: Apache-2.0
"""Speckle of a scene that stands still."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.light import Light
from activestereo.effects.core.speckle import speckled
from activestereo.effects.core.view import View


@moves("signal.speckle_shape", "signal.speckle_scale", "signal.speckle_correlation", "speckle_of_laser")
def _engine(inputs: EngineInputs, contrast: float) -> None:
    inputs.add_speckle(contrast, 1.0)


@effect(
    "speckle_static",
    stage=Stage.SURFACE,
    family="speckle",
    finding="The laser's light is grainy, with grains that stay (speckle)",
    source="Goodman, Speckle Phenomena in Optics, 3.4; does not average out over frames (librealsense issue 1375)",
    randomness=Randomness.STATIC,
    judged=(RandomTerm("contrast", Lever.PROJECTOR, SharedBy.VIEW),),
    parameters=[Parameter("contrast", "1", neutral=0.0, low=0.0, high=0.8, typical=0.1)],
    engine=_engine,
)
def speckle_static(light: Light, view: View, contrast: float) -> Light:
    """Projected light is grainy; the grains are the same in repeats, and new when rig or scene moves."""
    return speckled(light, view, "speckle_static", contrast, "pose")
