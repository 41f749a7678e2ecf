# SPDX-License-Identifier: Apache-2.0
"""Simulates laser speckle that stays while rig and scene stand still."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "speckle_static",
    moves=("signal.speckle_shape", "signal.speckle_scale", "signal.speckle_correlation", "speckle_of_laser"),
    stage=Stage.SURFACE,
    family="speckle",
    finding="The laser's light is grainy, with grains that stay (speckle)",
    source="Goodman, Speckle Phenomena in Optics, 3.4; does not average out over frames (librealsense issue 1375)",
    randomness=Randomness.STATIC,
    judged=(RandomTerm("contrast", Lever.PROJECTOR, SharedBy.VIEW),),
    parameters=[Parameter("contrast", "1", neutral=0.0, low=0.0, high=0.8, typical=0.1)],
)
def speckle_static(inputs: EngineInputs, contrast: float) -> None:
    """Projected light is grainy; the grains are the same in repeats, and new when rig or scene moves."""
    inputs.add_speckle(contrast, 1.0)
