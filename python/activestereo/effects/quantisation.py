# SPDX-License-Identifier: Apache-2.0
"""Simulates coarse digital steps."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.judging import CodeSteps
from activestereo.effects.core.view import View


@effect(
    "quantisation",
    stage=Stage.DIGITAL,
    family="quantisation",
    finding="Values are rounded to coarse steps",
    source="an ideal quantiser of step q adds a variance of q^2 / 12 (Bennett 1948)",
    judged=(CodeSteps("step_dn"),),
    parameters=[
        Parameter("step_dn", "DN", neutral=0.0, low=0.0, high=32.0, typical=2.0, source="1 = whole digital numbers")
    ],
    image_only="simsense's converter rounds to whole digital numbers only",
)
def quantisation(dn: np.ndarray, view: View, step_dn: float) -> np.ndarray:
    """Values are rounded to multiples of a step."""
    return dn if step_dn == 0.0 else step_dn * np.rint(dn / step_dn)
