# SPDX-License-Identifier: Apache-2.0
"""Effects of imagers: charge, noise, response and digits."""

import numpy as np

from activestereo.effects.core.descriptor import (
    CodeSteps,
    Lever,
    Parameter,
    Randomness,
    RandomTerm,
    SharedBy,
    Stage,
    StartImage,
    effect,
)
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.view import View


@engine_effect(
    stage=Stage.CHARGE, family="dark", moves=("signal.dark_current_e_per_s", "signal.dark_doubling_k"),
    finding="Charge gathers without light",
    source="EMVA 1288; dark current of silicon doubles every 6-8 K",
    parameters=[
        Parameter("rate_dn_per_s", "DN/s", high=5000.0, typical=100.0, source="at 25 C and gain 1"),
        Parameter("doubling_k", "K", neutral=7.0, low=4.0, high=12.0, typical=1.0),
    ],
)  # fmt: skip
def dark_signal(inputs: EngineInputs, rate_dn_per_s: float, doubling_k: float) -> None:
    """Charge gathers without light. It is proportional to the exposure, and doubles with every doubling_k kelvins."""
    for side in inputs.sides:
        side.signal["dark_current_e_per_s"] += rate_dn_per_s / side.signal["conversion_gain_dn_per_e"]
        side.signal["dark_doubling_k"] = doubling_k


@engine_effect(
    stage=Stage.DIGITAL, family="dark", moves=("signal.black_level_dn", "signal.black_level_dn_per_k"),
    finding="The black level is another one than the model's",
    source="pedestals of 5 (D415) and 20 DN (D435) seen on public frames; drift with temperature and gain",
    parameters=[
        Parameter("offset_dn", "DN", low=-50.0, high=50.0, typical=2.0,
                  source="the fit's black level absorbs a constant one"),
        Parameter("per_k_dn", "DN/K", low=-1.0, high=1.0, typical=0.05),
    ],
)  # fmt: skip
def black_level(inputs: EngineInputs, offset_dn: float, per_k_dn: float) -> None:
    """A pedestal is added to every pixel, with or without light. It moves with temperature."""
    for side in inputs.sides:
        side.signal["black_level_dn"] += offset_dn
        side.signal["black_level_dn_per_k"] += per_k_dn


@engine_effect(
    stage=Stage.CHARGE, family="fixed pattern", randomness=Randomness.STATIC, moves=("signal.prnu",),
    finding="Every pixel has a gain of its own",
    source="EMVA 1288 photo response non-uniformity, 0.5-2 %",
    judged=(RandomTerm("sigma", Lever.SIGNAL),),
    parameters=[Parameter("sigma", "1", high=0.5, typical=0.01)],
)  # fmt: skip
def prnu(inputs: EngineInputs, sigma: float) -> None:
    """Every pixel has its own gain. The gain is the same in all frames."""
    for side in inputs.sides:
        side.add_variance("prnu", sigma)


@engine_effect(
    stage=Stage.READOUT, family="fixed pattern", randomness=Randomness.STATIC,
    moves=("signal.column_fixed_e", "signal.row_fixed_e", "signal.dsnu_e"),
    finding="Columns, rows or pixels have offsets of their own",
    source="EMVA 1288 dark signal non-uniformity, split by column and row readout",
    judged=(
        RandomTerm("column_dn", Lever.ONE, SharedBy.COLUMN),
        RandomTerm("row_dn", Lever.ONE, SharedBy.ROW),
        RandomTerm("pixel_dn", Lever.ONE),
    ),
    parameters=[
        Parameter("column_dn", "DN", high=10.0, typical=0.3),
        Parameter("row_dn", "DN", high=10.0, typical=0.3),
        Parameter("pixel_dn", "DN", high=10.0, typical=0.3),
    ],
)  # fmt: skip
def fixed_pattern_noise(inputs: EngineInputs, column_dn: float, row_dn: float, pixel_dn: float) -> None:
    """Columns, rows and pixels have offsets of their own. The offsets are the same in all frames."""
    for side in inputs.sides:
        side.add_variance("column_fixed_e", side.electrons(column_dn))
        side.add_variance("row_fixed_e", side.electrons(row_dn))
        side.add_variance("dsnu_e", side.electrons(pixel_dn))


@engine_effect(
    stage=Stage.CHARGE, family="dark", randomness=Randomness.STATIC,
    moves=("signal.hot_pixel_share", "signal.hot_pixel_e_per_s"),
    finding="Some pixels are hot",
    source="EMVA 1288 defect pixels, 1e-5 to 1e-3 of all; exponential tail of dark current",
    judged=(RandomTerm("rate_dn_per_s", Lever.EXPOSURE, sparse_share="share"),),
    parameters=[
        Parameter("share", "1", high=0.05, typical=0.002),
        Parameter("rate_dn_per_s", "DN/s", neutral=2000.0, high=100000.0, typical=2000.0,
                  source="mean of the tail at gain 1"),
    ],
)  # fmt: skip
def hot_pixels(inputs: EngineInputs, share: float, rate_dn_per_s: float) -> None:
    """A share of the pixels gathers charge without light. The charge is exponentially distributed. The pixels are the
    same in all frames."""
    for side in inputs.sides:
        side.signal["hot_pixel_share"] = share
        # The parameter holds at the present temperature, simsense's field at the reference temperature.
        warming = 2.0 ** (inputs.warming_k / side.signal["dark_doubling_k"])
        side.signal["hot_pixel_e_per_s"] = rate_dn_per_s / (side.signal["conversion_gain_dn_per_e"] * warming)


@engine_effect(
    stage=Stage.CHARGE, family="temporal noise", randomness=Randomness.TEMPORAL, moves=("signal.shot_noise",),
    finding="There is more shot noise than the model has",
    source="EMVA 1288 photon transfer; 0.005 DN on resampled D4xx frames at 640x480",
    judged=(RandomTerm("dn_per_electron", Lever.PHOTONS),),
    parameters=[Parameter("dn_per_electron", "DN", high=2.0, typical=0.03, source="at gain 1")],
)  # fmt: skip
def shot_noise(inputs: EngineInputs, dn_per_electron: float) -> None:
    """Photons arrive at random. The variance grows in proportion to signal and gain."""
    for side in inputs.sides:
        # A share s of an electron's own fluctuation: variance s^2 K DN per DN at gain 1, K the conversion gain.
        side.add_variance("shot_noise", np.sqrt(dn_per_electron / side.signal["conversion_gain_dn_per_e"]))


@engine_effect(
    stage=Stage.READOUT, family="temporal noise", randomness=Randomness.TEMPORAL, moves=("signal.read_noise_e",),
    finding="There is more noise of the amplifier than the model has",
    source="EMVA 1288; 0.2-1 DN on D4xx",
    judged=(RandomTerm("sigma_dn", Lever.ONE),),
    parameters=[Parameter("sigma_dn", "DN", high=20.0, typical=0.8)],
)  # fmt: skip
def read_noise(inputs: EngineInputs, sigma_dn: float) -> None:
    """The amplifier adds noise that no light changes."""
    for side in inputs.sides:
        side.add_variance("read_noise_e", side.electrons(sigma_dn))


@engine_effect(
    stage=Stage.READOUT, family="temporal noise", randomness=Randomness.TEMPORAL, moves=("signal.row_noise_e",),
    finding="Every row of every frame has an offset of its own",
    source="row-wise reference sampling of CMOS imagers; <= 0.03 DN on D4xx",
    judged=(RandomTerm("sigma_dn", Lever.ONE, SharedBy.ROW),),
    parameters=[Parameter("sigma_dn", "DN", high=10.0, typical=0.3)],
)  # fmt: skip
def row_noise(inputs: EngineInputs, sigma_dn: float) -> None:
    """Every row of every frame has an offset of its own."""
    for side in inputs.sides:
        side.add_variance("row_noise_e", side.electrons(sigma_dn))


@engine_effect(
    stage=Stage.CHARGE, family="tone", moves=("signal.exposure_s", "signal.gain"),
    finding="Exposures or gains are others than recorded",
    source="EMVA 1288 linearity: exposure offsets of microseconds, gain steps off by per cents",
    parameters=[
        Parameter("exposure_offset_s", "s", low=-2e-4, high=1e-3, typical=1e-4,
                  source="true minus recorded exposure time"),
        Parameter("log_gain", "1", low=-0.5, high=0.5, typical=0.05, source="true gain = recorded gain^(1 + log_gain)"),
    ],
)  # fmt: skip
def gain_error(inputs: EngineInputs, exposure_offset_s: float, log_gain: float) -> None:
    """The ratio between frames of different exposure or gain differs from the recorded settings. Frames with one
    setting cannot show this."""
    for side in inputs.sides:
        side.signal["exposure_s"] = max(0.0, side.signal["exposure_s"] + exposure_offset_s)
        side.signal["gain"] *= inputs.frame.gain**log_gain


@engine_effect(
    stage=Stage.READOUT, family="tone", moves=("signal.gain", "signal.black_level_dn"),
    finding="The two cameras differ in gain or offset",
    source="real pairs: slope 1.062 and -3.8 DN (D435), 0.946 and +3.9 DN (D415)",
    parameters=[
        Parameter("gain", "1", low=-0.5, high=0.5, typical=0.05, source="right over left, minus 1"),
        Parameter("offset_dn", "DN", low=-20.0, high=20.0, typical=2.0),
    ],
)  # fmt: skip
def gain_mismatch(inputs: EngineInputs, gain: float, offset_dn: float) -> None:
    """The cameras differ in gain and offset. The difference is split: the right camera gets half of gain and offset,
    the left camera the opposite half."""
    for side, half in zip(inputs.sides, (-0.5, 0.5), strict=True):
        side.signal["gain"] *= 1.0 + half * gain
        side.signal["black_level_dn"] += half * offset_dn


@engine_effect(
    stage=Stage.READOUT, family="tone", is_pointwise=True, moves=("signal.response_exponent",),
    finding="The camera's response to light is not linear",
    source="power-law camera response (Mitsunaga and Nayar 1999 treat the general case)",
    parameters=[
        Parameter("log_exponent", "1", low=-1.0, high=1.0, typical=0.15, source="natural logarithm of the exponent"),
    ],
)  # fmt: skip
def response_gamma(inputs: EngineInputs, log_exponent: float) -> None:
    """The output is proportional to light^exp(log_exponent). Full scale is unchanged, and the black level is added
    afterwards."""
    for side in inputs.sides:
        side.signal["response_exponent"] *= np.exp(log_exponent)


# The brightest pixel but for so large a part, the levels below it at which a well may be full, and the spill tried.
_BRIGHTEST, _FULL_AT, _SPILL = 1e-3, (1.0, 0.85, 0.7, 0.5), 0.15


def _wells(images: list[StartImage]) -> list[dict[str, float]]:
    """Returns {lost_range, spill} of wells that are full at, or somewhat below, the brightest measured pixels."""
    brightest = max(
        (float(np.quantile(o.expected + o.residual, 1.0 - _BRIGHTEST)) / o.view.max_dn for o in images), default=0.0
    )
    return [{"lost_range": float(np.clip(1.0 - at * brightest, 0.0, 0.95)), "spill": _SPILL} for at in _FULL_AT]


@engine_effect(
    stage=Stage.CHARGE, family="saturation", starts=_wells, moves=("signal.full_well_e", "signal.blooming"),
    finding="Bright pixels saturate early and spill into their neighbours",
    source="Janesick, Photon Transfer, full well and blooming",
    parameters=[
        Parameter("lost_range", "1", high=0.95, typical=0.3, source="the well is full at (1 - this) of the range"),
        Parameter("spill", "1", high=1.0, typical=0.3,
                  source="share of the overflow that reaches the column's neighbours"),
    ],
)  # fmt: skip
def saturation_blooming(inputs: EngineInputs, lost_range: float, spill: float) -> None:
    """Pixels stop counting before the range ends. Further charge spills into the pixels above and below."""
    if lost_range > 0.0:
        for side in inputs.sides:
            side.signal["full_well_e"] = side.electrons((1.0 - lost_range) * inputs.max_dn)
            side.signal["blooming"] = spill


@effect(
    stage=Stage.DIGITAL, family="quantisation",
    finding="Values are rounded to coarse steps",
    source="an ideal quantiser of step q adds a variance of q^2 / 12 (Bennett 1948)",
    image_only="simsense's converter rounds to whole digital numbers only",
    judged=(CodeSteps("step_dn"),),
    parameters=[Parameter("step_dn", "DN", high=32.0, typical=2.0, source="1 = whole digital numbers")],
)  # fmt: skip
def quantisation(dn: np.ndarray, view: View, step_dn: float) -> np.ndarray:
    """The camera rounds values to multiples of a step."""
    return dn if step_dn == 0.0 else step_dn * np.rint(dn / step_dn)
