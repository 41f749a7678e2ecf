# SPDX-License-Identifier: Apache-2.0
"""Simulates cameras of unequal gain."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "gain_mismatch",
    moves=("signal.gain", "signal.black_level_dn"),
    stage=Stage.READOUT,
    family="tone",
    finding="The two cameras differ in gain or offset",
    source="real pairs: slope 1.062 and -3.8 DN (D435), 0.946 and +3.9 DN (D415)",
    parameters=[
        Parameter("gain", "1", neutral=0.0, low=-0.5, high=0.5, typical=0.05, source="right over left, minus 1"),
        Parameter("offset_dn", "DN", neutral=0.0, low=-20.0, high=20.0, typical=2.0),
    ],
)
def gain_mismatch(inputs: EngineInputs, gain: float, offset_dn: float) -> None:
    """The cameras differ in gain and offset. The difference is split: the right camera gets half of gain and offset,
    the left camera the opposite half."""
    for side, half in zip(inputs.sides, (-0.5, 0.5), strict=True):
        side.signal["gain"] *= 1.0 + half * gain
        side.signal["black_level_dn"] += half * offset_dn
