# SPDX-License-Identifier: Apache-2.0
"""Simulates a pattern that grows or shrinks, as laser wavelength changes against a diffractive element."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "pattern_scale_drift",
    moves=("projector.pattern_scale", "projector.distortion"),
    stage=Stage.PROJECTOR,
    family="pattern geometry",
    finding="The projector's pattern has changed its size",
    source="grating equation: sine of the angle in proportion to wavelength; 0.06-0.3 nm/K at 850 nm",
    parameters=[
        Parameter("scale", "1", neutral=0.0, low=-0.02, high=0.02, typical=0.002),
        Parameter("per_k", "1/K", neutral=0.0, low=-1e-3, high=1e-3, typical=1e-4),
    ],
    is_pointwise=True,
)
def pattern_scale_drift(inputs: EngineInputs, scale: float, per_k: float) -> None:
    """The sines of the pattern's angles from the projector's axis grow by 1 + scale + per_k x (kelvins above 25 C)."""
    growth = 1.0 + scale + per_k * inputs.warming_k
    if inputs.projector is not None and growth != 1.0:
        # Light at a tangent t came from t (1 + e (1 + t^2))^-0.5, e = growth^2 - 1: Brown's k1, k2 to e^2.
        e, (k1, k2, p1, p2, k3, k4, k5, k6) = growth**2 - 1.0, inputs.projector.distortion
        k1, k2 = k1 - growth * e * (0.5 - 0.75 * e), k2 + 0.375 * growth * e**2
        inputs.projector.distortion = (k1, k2, p1, p2, k3, k4, k5, k6)
        inputs.projector.pattern_scale *= growth
