# SPDX-License-Identifier: Apache-2.0
"""Pattern that grows or shrinks: laser wavelength against a diffractive element."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.dots import DotView
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View

_LEAST_COSINE2 = 1e-6


@moves("projector.pattern_scale", "projector.distortion")
def _engine(inputs: EngineInputs, scale: float, per_k: float) -> None:
    growth = scale + per_k * inputs.warming_k
    if inputs.projector is not None and growth != 0.0:
        # Sines that grow by g let a tangent t grow by g (1 + t^2), to first order: a magnification and Brown's k1 of
        # where light comes from.
        k1, k2, p1, p2, k3, k4, k5, k6 = inputs.projector.distortion
        inputs.projector.distortion = (k1 - growth, k2, p1, p2, k3, k4, k5, k6)
        inputs.projector.pattern_scale *= 1.0 + growth


@effect(
    "pattern_scale_drift",
    stage=Stage.PROJECTOR,
    family="pattern geometry",
    finding="The projector's pattern has changed its size",
    source="grating equation: sine of the angle in proportion to wavelength; 0.06-0.3 nm/K at 850 nm",
    parameters=[
        Parameter("scale", "1", neutral=0.0, low=-0.02, high=0.02, typical=0.002),
        Parameter("per_k", "1/K", neutral=0.0, low=-1e-3, high=1e-3, typical=1e-4),
    ],
    engine=_engine,
    is_pointwise=True,
)
def pattern_scale_drift(light: Light, view: View, scale: float, per_k: float) -> Light:
    """The sines of the pattern's angles from the projector's axis grow by 1 + scale + per_k x (kelvins above 25 C)."""
    growth = 1.0 + scale + per_k * view.warming_k
    if growth == 1.0:
        return light
    dots, K = DotView.of(view), view.projector_K
    after = dots.mean(view.pattern, *_before(dots.u, dots.v, K, growth))
    return dots.change(light, dots.nominal(), after)


def _before(u: np.ndarray, v: np.ndarray, K: np.ndarray, growth: float) -> tuple[np.ndarray, np.ndarray]:
    """Pattern pixels that light at (u, v) would have reached without the growth."""
    y = (v - K[1, 2]) / K[1, 1]
    x = (u - K[0, 2] - K[0, 1] * y) / K[0, 0]
    square = x * x + y * y
    # Sine s = t / sqrt(1 + t^2) of the tangent t; of s / growth the tangent again. No light went beyond a right angle.
    ratio = 1.0 / np.sqrt(np.maximum(growth**2 * (1.0 + square) - square, _LEAST_COSINE2))
    x, y = x * ratio, y * ratio
    return K[0, 0] * x + K[0, 1] * y + K[0, 2], K[1, 1] * y + K[1, 2]
