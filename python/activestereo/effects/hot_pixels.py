# SPDX-License-Identifier: Apache-2.0
"""Pixels with much dark current."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.view import View


@moves("signal.hot_pixel_share", "signal.hot_pixel_e_per_s")
def _engine(inputs: EngineInputs, share: float, rate_dn_per_s: float) -> None:
    for side in inputs.sides:
        side.signal["hot_pixel_share"] = share
        # The tail is that of the present temperature; simsense's is that of the reference.
        warming = 2.0 ** (inputs.warming_k / side.signal["dark_doubling_k"])
        side.signal["hot_pixel_e_per_s"] = rate_dn_per_s / (side.signal["conversion_gain_dn_per_e"] * warming)


@effect(
    "hot_pixels",
    stage=Stage.CHARGE,
    family="dark",
    finding="Some pixels are hot",
    source="EMVA 1288 defect pixels, 1e-5 to 1e-3 of all; exponential tail of dark current",
    randomness=Randomness.STATIC,
    judged=(RandomTerm("rate_dn_per_s", Lever.EXPOSURE, sparse_share="share"),),
    parameters=[
        Parameter("share", "1", neutral=0.0, low=0.0, high=0.05, typical=0.002),
        Parameter(
            "rate_dn_per_s",
            "DN/s",
            neutral=2000.0,
            low=0.0,
            high=100000.0,
            typical=2000.0,
            source="mean of the tail at gain 1",
        ),
    ],
    engine=_engine,
)
def hot_pixels(signal: np.ndarray, view: View, share: float, rate_dn_per_s: float) -> np.ndarray:
    """A share of the pixels gathers charge without light, exponentially distributed, the same pixels in all frames."""
    rng = view.rng("hot_pixels")
    hot = rng.random(signal.shape) < share
    strength = rng.standard_exponential(signal.shape)
    return signal + np.where(hot, strength, 0.0) * rate_dn_per_s * view.frame.exposure_gain
