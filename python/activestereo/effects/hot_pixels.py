# SPDX-License-Identifier: Apache-2.0
"""Simulates pixels with much dark current."""

from activestereo.effects.core.descriptor import Parameter, Randomness, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import Lever, RandomTerm
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "hot_pixels",
    moves=("signal.hot_pixel_share", "signal.hot_pixel_e_per_s"),
    stage=Stage.CHARGE,
    family="dark",
    finding="Some pixels are hot",
    source="EMVA 1288 defect pixels, 1e-5 to 1e-3 of all; exponential tail of dark current",
    randomness=Randomness.STATIC,
    judged=(RandomTerm("rate_dn_per_s", Lever.EXPOSURE, sparse_share="share"),),
    parameters=[
        Parameter("share", "1", neutral=0.0, low=0.0, high=0.05, typical=0.002),
        Parameter(
            "rate_dn_per_s", "DN/s", neutral=2000.0, low=0.0, high=100000.0, typical=2000.0,
            source="mean of the tail at gain 1",
        ),
    ],
)  # fmt: skip
def hot_pixels(inputs: EngineInputs, share: float, rate_dn_per_s: float) -> None:
    """A share of the pixels gathers charge without light, exponentially distributed, the same pixels in all frames."""
    for side in inputs.sides:
        side.signal["hot_pixel_share"] = share
        # The parameter holds at the present temperature, simsense's field at the reference temperature.
        warming = 2.0 ** (inputs.warming_k / side.signal["dark_doubling_k"])
        side.signal["hot_pixel_e_per_s"] = rate_dn_per_s / (side.signal["conversion_gain_dn_per_e"] * warming)
