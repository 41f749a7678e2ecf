# SPDX-License-Identifier: Apache-2.0
"""Speckle that boils: mode hopping, vibration."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.light import Light
from activestereo.effects.core.speckle import speckled
from activestereo.effects.core.view import View


@moves("signal.speckle_shape", "signal.speckle_scale", "speckle_of_laser")
def _engine(inputs: EngineInputs, contrast: float) -> None:
    inputs.add_speckle(contrast, 0.0)


@effect(
    "speckle_temporal",
    stage=Stage.SURFACE,
    family="speckle",
    finding="The laser's light is grainy, with other grains in every frame (speckle)",
    source="Goodman, Speckle Phenomena in Optics, 3.4; gamma noise of Landau 2015 (Kinect)",
    randomness=Randomness.TEMPORAL,
    judged=(RandomTerm("contrast", Lever.SIGNAL),),
    parameters=[Parameter("contrast", "1", neutral=0.0, low=0.0, high=0.8, typical=0.1)],
    engine=_engine,
)
def speckle_temporal(light: Light, view: View, contrast: float) -> Light:
    """Projected light is grainy, with new grains in every frame: temporal variance grows with intensity squared."""
    return speckled(light, view, "speckle_temporal", contrast, "frame")
