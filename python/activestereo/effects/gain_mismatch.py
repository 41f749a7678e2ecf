# SPDX-License-Identifier: Apache-2.0
"""Cameras of unequal gain."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.view import View


@moves("signal.gain", "signal.black_level_dn")
def _engine(inputs: EngineInputs, gain: float, offset_dn: float) -> None:
    for side, half in zip(inputs.sides, (-0.5, 0.5), strict=True):
        side.signal["gain"] *= 1.0 + half * gain
        side.signal["black_level_dn"] += half * offset_dn


@effect(
    "gain_mismatch",
    stage=Stage.READOUT,
    family="tone",
    finding="The two cameras differ in gain or offset",
    source="real pairs: slope 1.062 and -3.8 DN (D435), 0.946 and +3.9 DN (D415)",
    parameters=[
        Parameter("gain", "1", neutral=0.0, low=-0.5, high=0.5, typical=0.05, source="right over left, minus 1"),
        Parameter("offset_dn", "DN", neutral=0.0, low=-20.0, high=20.0, typical=2.0),
    ],
    engine=_engine,
)
def gain_mismatch(signal: np.ndarray, view: View, gain: float, offset_dn: float) -> np.ndarray:
    """The cameras differ in gain and offset. The difference is split: the right camera gets half of gain and offset,
    the left camera the opposite half."""
    half = 0.5 if view.is_right else -0.5
    return signal * (1.0 + half * gain) + half * offset_dn
