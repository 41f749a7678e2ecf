# SPDX-License-Identifier: Apache-2.0
"""Filter and focus that drift with the laser's wavelength."""

from dataclasses import replace

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@moves("projector.ir_intensity", "pattern")
def _engine(inputs: EngineInputs, transmission_per_k: float, sigma_px_per_k: float) -> None:
    warming_k = abs(inputs.warming_k)
    if inputs.projector is not None and inputs.projector.ir_intensity is not None:
        inputs.projector.ir_intensity *= max(0.0, 1.0 + transmission_per_k * warming_k)
        inputs.blur_pattern(sigma_px_per_k * warming_k)


@effect(
    "chromatic_drift",
    stage=Stage.SURFACE,
    family="projector power",
    finding="The laser's colour drifts out of the filter's band with temperature",
    source="850 nm lasers drift 0.06-0.3 nm/K against a fixed band-pass filter and lens",
    parameters=[
        Parameter("transmission_per_k", "1/K", neutral=0.0, low=-0.03, high=0.01, typical=0.003),
        Parameter("sigma_px_per_k", "px/K", neutral=0.0, low=0.0, high=0.1, typical=0.01),
    ],
    engine=_engine,
)
def chromatic_drift(light: Light, view: View, transmission_per_k: float, sigma_px_per_k: float) -> Light:
    """Per kelvin away from 25 C the filter passes less of the projected light, and it is less in focus; ambient light
    stays."""
    gain = max(0.0, 1.0 + transmission_per_k * abs(view.warming_k))
    sigma = sigma_px_per_k * abs(view.warming_k)
    dimmed = light.scale_projector(gain)
    if sigma == 0.0:
        return dimmed
    seen = dimmed.blurred(sigma)
    return replace(dimmed, direct=seen.direct, flat=seen.flat)
