# SPDX-License-Identifier: Apache-2.0
"""Simulates filter and focus errors as the laser's wavelength drifts with temperature."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "chromatic_drift",
    moves=("projector.ir_intensity", "pattern"),
    stage=Stage.SURFACE,
    family="projector power",
    finding="The laser's colour drifts out of the filter's band with temperature",
    source="850 nm lasers drift 0.06-0.3 nm/K against a fixed band-pass filter and lens",
    parameters=[
        Parameter("transmission_per_k", "1/K", neutral=0.0, low=-0.03, high=0.01, typical=0.003),
        Parameter("sigma_px_per_k", "px/K", neutral=0.0, low=0.0, high=0.1, typical=0.01),
    ],
)
def chromatic_drift(inputs: EngineInputs, transmission_per_k: float, sigma_px_per_k: float) -> None:
    """Per kelvin away from 25 C the filter passes less of the projected light, and it is less in focus; ambient light
    stays."""
    warming_k = abs(inputs.warming_k)
    if inputs.projector is not None and inputs.projector.ir_intensity is not None:
        inputs.projector.ir_intensity *= max(0.0, 1.0 + transmission_per_k * warming_k)
        inputs.blur_pattern(sigma_px_per_k * warming_k)
