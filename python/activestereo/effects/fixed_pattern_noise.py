# SPDX-License-Identifier: Apache-2.0
"""Simulates constant offsets of columns, rows and pixels."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "fixed_pattern_noise",
    moves=("signal.column_fixed_e", "signal.row_fixed_e", "signal.dsnu_e"),
    stage=Stage.READOUT,
    family="fixed pattern",
    finding="Columns, rows or pixels have offsets of their own",
    source="EMVA 1288 dark signal non-uniformity, split by column and row readout",
    randomness=Randomness.STATIC,
    judged=(
        RandomTerm("column_dn", Lever.ONE, SharedBy.COLUMN),
        RandomTerm("row_dn", Lever.ONE, SharedBy.ROW),
        RandomTerm("pixel_dn", Lever.ONE),
    ),
    parameters=[
        Parameter("column_dn", "DN", neutral=0.0, low=0.0, high=10.0, typical=0.3),
        Parameter("row_dn", "DN", neutral=0.0, low=0.0, high=10.0, typical=0.3),
        Parameter("pixel_dn", "DN", neutral=0.0, low=0.0, high=10.0, typical=0.3),
    ],
)
def fixed_pattern_noise(inputs: EngineInputs, column_dn: float, row_dn: float, pixel_dn: float) -> None:
    """Columns, rows and pixels have offsets of their own, the same in all frames."""
    for side in inputs.sides:
        side.add_variance("column_fixed_e", side.electrons(column_dn))
        side.add_variance("row_fixed_e", side.electrons(row_dn))
        side.add_variance("dsnu_e", side.electrons(pixel_dn))
