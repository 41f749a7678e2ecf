# SPDX-License-Identifier: Apache-2.0
"""Simulates photon shot noise."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "shot_noise",
    moves=("signal.shot_noise",),
    stage=Stage.CHARGE,
    family="temporal noise",
    finding="There is more shot noise than the model has",
    source="EMVA 1288 photon transfer; 0.005 DN on resampled D4xx frames at 640x480",
    randomness=Randomness.TEMPORAL,
    judged=(RandomTerm("dn_per_electron", Lever.PHOTONS),),
    parameters=[Parameter("dn_per_electron", "DN", neutral=0.0, low=0.0, high=2.0, typical=0.03, source="at gain 1")],
)
def shot_noise(inputs: EngineInputs, dn_per_electron: float) -> None:
    """Photons arrive at random: variance in proportion to signal and gain."""
    for side in inputs.sides:
        # A share s of an electron's own fluctuation: variance s^2 K DN per DN at gain 1, K the conversion gain.
        side.add_variance("shot_noise", np.sqrt(dn_per_electron / side.signal["conversion_gain_dn_per_e"]))
