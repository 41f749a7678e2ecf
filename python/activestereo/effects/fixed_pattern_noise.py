# SPDX-License-Identifier: Apache-2.0
"""Offsets of columns, rows and pixels that stay."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm, SharedBy
from activestereo.effects.core.view import View


def _variance(signal: np.ndarray, view: View, column_dn: float, row_dn: float, pixel_dn: float) -> np.ndarray:
    return np.full(signal.shape, column_dn**2 + row_dn**2 + pixel_dn**2)


@moves("signal.column_fixed_e", "signal.row_fixed_e", "signal.dsnu_e")
def _engine(inputs: EngineInputs, column_dn: float, row_dn: float, pixel_dn: float) -> None:
    for side in inputs.sides:
        side.add_variance("column_fixed_e", side.electrons(column_dn))
        side.add_variance("row_fixed_e", side.electrons(row_dn))
        side.add_variance("dsnu_e", side.electrons(pixel_dn))


@effect(
    "fixed_pattern_noise",
    stage=Stage.READOUT,
    family="fixed pattern",
    finding="Columns, rows or pixels have offsets of their own",
    source="EMVA 1288 dark signal non-uniformity, split by column and row readout",
    randomness=Randomness.STATIC,
    variance=_variance,
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
    engine=_engine,
)
def fixed_pattern_noise(signal: np.ndarray, view: View, column_dn: float, row_dn: float, pixel_dn: float) -> np.ndarray:
    """Columns, rows and pixels have offsets of their own, the same in all frames."""
    rng = view.rng("fixed_pattern_noise")
    height, width = signal.shape
    columns, rows = rng.standard_normal((1, width)), rng.standard_normal((height, 1))
    return signal + column_dn * columns + row_dn * rows + pixel_dn * rng.standard_normal(signal.shape)
