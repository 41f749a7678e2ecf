# SPDX-License-Identifier: Apache-2.0
"""Simulates exposure times and gains that differ from the frame's record."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "gain_error",
    moves=("signal.exposure_s", "signal.gain"),
    stage=Stage.CHARGE,
    family="tone",
    finding="Exposures or gains are others than recorded",
    source="EMVA 1288 linearity: exposure offsets of microseconds, gain steps off by per cents",
    parameters=[
        Parameter(
            "exposure_offset_s", "s", neutral=0.0, low=-2e-4, high=1e-3, typical=1e-4,
            source="true minus recorded exposure time",
        ),
        Parameter(
            "log_gain", "1", neutral=0.0, low=-0.5, high=0.5, typical=0.05,
            source="true gain = recorded gain^(1 + log_gain)",
        ),
    ],
)  # fmt: skip
def gain_error(inputs: EngineInputs, exposure_offset_s: float, log_gain: float) -> None:
    """The ratio between frames of different exposure or gain differs from the recorded settings. Frames with one
    setting cannot show this."""
    for side in inputs.sides:
        side.signal["exposure_s"] = max(0.0, side.signal["exposure_s"] + exposure_offset_s)
        side.signal["gain"] *= inputs.frame.gain**log_gain
