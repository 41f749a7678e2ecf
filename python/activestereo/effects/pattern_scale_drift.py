"""Pattern that grows or shrinks: laser wavelength against a diffractive element."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.dots import DotView


@effect(
    "pattern_scale_drift",
    stage=Stage.PROJECTOR,
    family="pattern geometry",
    source="grating equation: angle in proportion to wavelength; 0.06-0.3 nm/K at 850 nm",
    parameters=[
        Parameter("scale", "1", neutral=0.0, low=-0.02, high=0.02, typical=0.002),
        Parameter("per_k", "1/K", neutral=0.0, low=-1e-3, high=1e-3, typical=1e-4),
    ],
)
def pattern_scale_drift(light, view, scale, per_k):
    """The pattern is magnified about the projector's axis by 1 + scale + per_k x (kelvins above 25 C)."""
    growth = 1.0 + scale + per_k * view.warming_k
    if growth == 1.0:
        return light
    dots = DotView.of(view)
    cx, cy = view.projector_K[0, 2], view.projector_K[1, 2]
    after = dots.mean(view.pattern, cx + (dots.u - cx) / growth, cy + (dots.v - cy) / growth)
    return dots.change(light, dots.nominal, after)
