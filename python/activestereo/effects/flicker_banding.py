# SPDX-License-Identifier: Apache-2.0
"""Simulates ambient light that flickers with the mains."""

from dataclasses import replace

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.flicker import flicker_starts
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@effect(
    "flicker_banding",
    stage=Stage.SURFACE,
    family="ambient light",
    finding="The ambient light flickers",
    source="IEEE 1789: lamps vary at twice the mains frequency",
    starts=flicker_starts,
    parameters=[
        Parameter("depth", "1", neutral=0.0, low=0.0, high=1.0, typical=0.15),
        Parameter(
            "frequency_hz", "Hz", neutral=100.0, low=80.0, high=250.0, typical=20.0,
            slope_step=1e-3,  # a capture of a minute resolves a hundredth of a hertz
        ),
        Parameter("phase_rad", "rad", neutral=0.0, low=-np.pi, high=np.pi, typical=1.0),
        Parameter(
            "line_time_s", "s", neutral=0.0, low=0.0, high=1e-4, typical=2e-5,
            source="0 = all rows at once: frames vary, no bands",
        ),
    ],
    image_only="kuafu's lights do not vary within a frame",
)  # fmt: skip
def flicker_banding(
    light: Light, view: View, depth: float, frequency_hz: float, phase_rad: float, line_time_s: float
) -> Light:
    """Ambient light varies sinusoidally in time, averaged over each row's exposure."""
    height = view.shape[0]
    row_time = view.frame.timestamp_s + (np.arange(height) - (height - 1) / 2) * line_time_s
    averaged = depth * np.sinc(frequency_hz * view.frame.exposure_s)
    gain = 1.0 + averaged * np.sin(2 * np.pi * frequency_hz * row_time + phase_rad)
    return replace(light, ambient=light.ambient * gain[:, None])
