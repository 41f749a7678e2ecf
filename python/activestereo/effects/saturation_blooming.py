# SPDX-License-Identifier: Apache-2.0
"""Full wells that overflow."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.view import View


@moves("signal.full_well_e", "signal.blooming")
def _engine(inputs: EngineInputs, lost_range: float, spill: float) -> None:
    if lost_range > 0.0:
        for side in inputs.sides:
            side.signal["full_well_e"] = side.electrons((1.0 - lost_range) * inputs.max_dn)
            side.signal["blooming"] = spill


@effect(
    "saturation_blooming",
    stage=Stage.CHARGE,
    family="saturation",
    finding="Bright pixels saturate early and spill into their neighbours",
    source="Janesick, Photon Transfer, full well and blooming",
    parameters=[
        Parameter(
            "lost_range",
            "1",
            neutral=0.0,
            low=0.0,
            high=0.95,
            typical=0.3,
            source="the well is full at (1 - this) of the range",
        ),
        Parameter(
            "spill",
            "1",
            neutral=0.0,
            low=0.0,
            high=1.0,
            typical=0.3,
            source="share of the overflow that reaches the column's neighbours",
        ),
    ],
    engine=_engine,
)
def saturation_blooming(signal: np.ndarray, view: View, lost_range: float, spill: float) -> np.ndarray:
    """Pixels stop counting before the range ends, and spill into the pixels above and below."""
    full = (1.0 - lost_range) * view.max_dn
    columns = (signal > full).any(axis=0)
    if lost_range == 0.0 or not columns.any():
        return signal
    charge = np.minimum(signal, full)
    part, half = charge[:, columns], 0.5 * spill * np.maximum(signal[:, columns] - full, 0.0)
    # Half flows down its column, half up, until pixels have room for it: simsense's rule.
    for rows in (range(len(part)), reversed(range(len(part)))):
        flow = np.zeros(part.shape[1])
        for y in rows:
            taken = np.minimum(flow, full - part[y])
            part[y] += taken
            flow += half[y] - taken
    charge[:, columns] = part
    return charge
