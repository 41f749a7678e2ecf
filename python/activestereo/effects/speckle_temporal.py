# SPDX-License-Identifier: Apache-2.0
"""Simulates laser speckle that changes in every frame, by mode hopping or vibration."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "speckle_temporal",
    moves=("signal.speckle_shape", "signal.speckle_scale", "speckle_of_laser"),
    stage=Stage.SURFACE,
    family="speckle",
    finding="The laser's light is grainy, with other grains in every frame (speckle)",
    source="Goodman, Speckle Phenomena in Optics, 3.4; gamma noise of Landau 2015 (Kinect)",
    randomness=Randomness.TEMPORAL,
    judged=(RandomTerm("contrast", Lever.SIGNAL),),
    parameters=[Parameter("contrast", "1", neutral=0.0, low=0.0, high=0.8, typical=0.1)],
)
def speckle_temporal(inputs: EngineInputs, contrast: float) -> None:
    """Projected light is grainy, with new grains in every frame: temporal variance grows with intensity squared."""
    inputs.add_speckle(contrast, 0.0)
