# SPDX-License-Identifier: Apache-2.0
"""Effects of the projector: its power, its pattern, its dots and its laser's speckle."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from activestereo.effects.core.descriptor import Lever, Parameter, Randomness, RandomTerm, SharedBy, Stage, StartImage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect, tangents


@engine_effect(
    stage=Stage.PROJECTOR, family="projector power", moves=("projector.ir_intensity",),
    finding="The projector's power drifts",
    source="laser diodes lose 0.2-1 % of power per kelvin at constant current; firmware derates when hot (librealsense "
           "issue 10476)",
    parameters=[
        Parameter("per_k", "1/K", low=-0.03, high=0.03, typical=0.004),
        Parameter("per_s", "1/s", low=-0.02, high=0.02, typical=0.002),
    ],
)  # fmt: skip
def laser_power_drift(inputs: EngineInputs, per_k: float, per_s: float) -> None:
    """All projected light changes by the factor exp(per_k) with every kelvin above 25 C. It also changes with the time
    since the capture began."""
    if inputs.projector is not None and inputs.projector.ir_intensity is not None:
        aged = max(0.0, 1.0 + per_s * inputs.frame.timestamp_s)
        inputs.projector.ir_intensity *= float(np.exp(per_k * inputs.warming_k)) * aged


@engine_effect(
    stage=Stage.SURFACE, family="projector power", moves=("projector.ir_intensity", "pattern"),
    finding="The laser's colour drifts out of the filter's band with temperature",
    source="850 nm lasers drift 0.06-0.3 nm/K against a fixed band-pass filter and lens",
    parameters=[
        Parameter("transmission_per_k", "1/K", low=-0.03, high=0.01, typical=0.003),
        Parameter("sigma_px_per_k", "px/K", high=0.1, typical=0.01),
    ],
)  # fmt: skip
def chromatic_drift(inputs: EngineInputs, transmission_per_k: float, sigma_px_per_k: float) -> None:
    """The filter passes less of the projected light with every kelvin away from 25 C. The light is then also less in
    focus. Ambient light stays."""
    warming_k = abs(inputs.warming_k)
    if inputs.projector is not None and inputs.projector.ir_intensity is not None:
        inputs.projector.ir_intensity *= max(0.0, 1.0 + transmission_per_k * warming_k)
        inputs.blur_pattern(sigma_px_per_k * warming_k)


@engine_effect(
    stage=Stage.PROJECTOR, family="pattern geometry", is_pointwise=True,
    moves=("projector.pattern_scale", "projector.distortion"),
    finding="The projector's pattern has changed its size",
    source="grating equation: sine of the angle in proportion to wavelength; 0.06-0.3 nm/K at 850 nm",
    parameters=[
        Parameter("scale", "1", low=-0.02, high=0.02, typical=0.002),
        Parameter("per_k", "1/K", low=-1e-3, high=1e-3, typical=1e-4),
    ],
)  # fmt: skip
def pattern_scale_drift(inputs: EngineInputs, scale: float, per_k: float) -> None:
    """The sines of the pattern's angles from the projector's axis grow by 1 + scale + per_k x (kelvins above 25 C)."""
    growth = 1.0 + scale + per_k * inputs.warming_k
    if inputs.projector is not None and growth != 1.0:
        # Light at a tangent t came from t (1 + e (1 + t^2))^-0.5, e = growth^2 - 1: Brown's k1, k2 to e^2.
        e, (k1, k2, p1, p2, k3, k4, k5, k6) = growth**2 - 1.0, inputs.projector.distortion
        k1, k2 = k1 - growth * e * (0.5 - 0.75 * e), k2 + 0.375 * growth * e**2
        inputs.projector.distortion = (k1, k2, p1, p2, k3, k4, k5, k6)
        inputs.projector.pattern_scale *= growth


@engine_effect(
    stage=Stage.PROJECTOR, family="projector blur", is_pointwise=True,
    moves=("projector.radius_m", "projector.focus_m"),
    finding="The projector is out of focus",
    source="thin lens: the blur circle's angular radius = aperture radius x |1/z - 1/z_focus|",
    parameters=[
        Parameter("aperture_px_m", "px m", high=6.0, typical=1.0,
                  source="radius of the aperture times focal length in pattern pixels"),
        Parameter("focus_m", "m", neutral=1.0, low=0.2, high=5.0, typical=0.5),
    ],
)  # fmt: skip
def projector_defocus(inputs: EngineInputs, aperture_px_m: float, focus_m: float) -> None:
    """Each dot becomes a disc. Its radius in pattern pixels is aperture x |1/z - 1/focus|. Ambient edges stay sharp."""
    if inputs.projector is not None and aperture_px_m > 0.0:
        inputs.projector.radius_m = aperture_px_m / np.mean(np.diag(inputs.projector.k)[:2])
        inputs.projector.focus_m = focus_m


@engine_effect(
    stage=Stage.PROJECTOR, family="projector shading", moves=("pattern",),
    finding="The projector is darker towards its edges",
    source="radiant intensity of a collimated diffractive projector falls with a power of cos",
    parameters=[Parameter("exponent", "1", high=12.0, typical=1.5)],
)  # fmt: skip
def projector_vignetting(inputs: EngineInputs, exponent: float) -> None:
    """Projected light falls by cos^exponent of the angle to the projector's axis. Ambient light does not."""
    if inputs.pattern is None and inputs.projector is not None:
        inputs.projector.falloff += exponent
    elif exponent != 0.0:  # kuafu's own falloff needs its slower shading of shaped lights
        inputs.dim_pattern(lambda x, y: (1.0 + x * x + y * y) ** (-0.5 * exponent))


# The grid and the radius of the first trials, in tangents of angles from the projector's axis.
_GRID, _RADIUS = (-0.4, -0.2, 0.0, 0.2, 0.4), 0.15
_BEST = 3


def _starts(images: Sequence[StartImage]) -> list[dict[str, float]]:
    """Returns starting values at the pattern's places where measured dots are dimmest relative to the expected ones. A
    regression of the residual on the dots around a place estimates how dim they are."""
    moment, power = np.zeros((2, len(_GRID), len(_GRID)))
    for image in images:
        x, y = (t.ravel() for t in tangents(image.view))
        dots, weight = image.light.projector.ravel(), image.weight.ravel()
        across, along = (np.exp(-0.5 * (t - np.array(_GRID)[:, None]) ** 2 / _RADIUS**2) for t in (x, y))
        moment -= (across * (dots * image.residual.ravel() * weight)) @ along.T
        power += (across**2 * (dots * dots * weight)) @ (along**2).T
    score = np.where(power > 0.0, moment / np.sqrt(np.maximum(power, 1e-300)), 0.0)
    scores = {(x, y): score[i, j] for i, x in enumerate(_GRID) for j, y in enumerate(_GRID)}
    best = sorted(scores, key=lambda place: -scores[place])[:_BEST]
    amounts = ({"depth": 0.3}, {"per_k": 0.015})
    return [{"place_x": x, "place_y": y, "radius": _RADIUS, **amount} for x, y in best for amount in amounts]


@engine_effect(
    stage=Stage.PROJECTOR, family="pattern strength", starts=_starts, moves=("pattern",),
    finding="Dots are dim or missing in a part of the pattern",
    source="emitters of an array age one by one, and more so where it is warm; dirt on the projector's window",
    parameters=[
        Parameter("depth", "1", high=1.0, typical=0.2),
        Parameter("per_k", "1/K", high=0.1, typical=0.01, source="more with each kelvin"),
        Parameter("place_x", "1", neutral=0.1, low=-1.0, high=1.0, typical=0.3, source="tangent from the axis"),
        Parameter("place_y", "1", neutral=0.1, low=-1.0, high=1.0, typical=0.3),
        Parameter("radius", "1", neutral=0.15, low=0.02, high=1.0, typical=0.1, source="a Gaussian's deviation"),
    ],
)  # fmt: skip
def dim_dots(inputs: EngineInputs, depth: float, per_k: float, place_x: float, place_y: float, radius: float) -> None:
    """The projector's light is weaker around a place of the pattern. Warmth makes it weaker still."""
    lost = depth + per_k * inputs.warming_k
    if lost != 0.0:
        shape = lambda x, y: np.exp(-0.5 * ((x - place_x) ** 2 + (y - place_y) ** 2) / radius**2)  # noqa: E731
        inputs.dim_pattern(lambda x, y: np.clip(1.0 - lost * shape(x, y), 0.0, None))


@engine_effect(
    stage=Stage.PROJECTOR, family="pattern strength", randomness=Randomness.STATIC, moves=("pattern",),
    finding="The projector's dots differ in brightness",
    source="coefficient of variation 0.4-0.5 over visible dots of D4xx, falloff included",
    judged=(RandomTerm("spread", Lever.PROJECTOR, SharedBy.DOT),),
    parameters=[
        Parameter("spread", "1", high=0.8, typical=0.15),
        Parameter("dot_px", "px", neutral=3.0, low=1.0, high=20.0, typical=2.0,
                  source="size of a dot in pattern pixels"),
    ],
)  # fmt: skip
def dot_gain_spread(inputs: EngineInputs, spread: float, dot_px: float) -> None:
    """Each dot has its own gain (log-normal, mean 1), which it keeps in every frame and in both cameras."""
    if spread > 0.0 and inputs.pattern is not None:
        draws = inputs.rng("dot_gain_spread").standard_normal(inputs.pattern.shape)
        smooth, width = gaussian_filter(draws, dot_px, mode="wrap"), np.sqrt(np.log1p(spread**2))
        inputs.pattern = inputs.pattern * np.exp(width * smooth / smooth.std() - 0.5 * width**2)


@engine_effect(
    stage=Stage.SURFACE, family="speckle", randomness=Randomness.STATIC,
    moves=("signal.speckle_shape", "signal.speckle_scale", "signal.speckle_correlation", "speckle_of_laser"),
    finding="The laser's light is grainy, with grains that stay (speckle)",
    source="Goodman, Speckle Phenomena in Optics, 3.4; does not average out over frames (librealsense issue 1375)",
    judged=(RandomTerm("contrast", Lever.PROJECTOR, SharedBy.VIEW),),
    parameters=[Parameter("contrast", "1", high=0.8, typical=0.1)],
)  # fmt: skip
def speckle_static(inputs: EngineInputs, contrast: float) -> None:
    """Projected light is grainy. The grains are the same in repeats, and new when the rig or the scene moves."""
    inputs.add_speckle(contrast, 1.0)


@engine_effect(
    stage=Stage.SURFACE, family="speckle", randomness=Randomness.TEMPORAL,
    moves=("signal.speckle_shape", "signal.speckle_scale", "speckle_of_laser"),
    finding="The laser's light is grainy, with other grains in every frame (speckle)",
    source="Goodman, Speckle Phenomena in Optics, 3.4; gamma noise of Landau 2015 (Kinect)",
    judged=(RandomTerm("contrast", Lever.SIGNAL),),
    parameters=[Parameter("contrast", "1", high=0.8, typical=0.1)],
)  # fmt: skip
def speckle_temporal(inputs: EngineInputs, contrast: float) -> None:
    """Projected light is grainy, with new grains in every frame. Its variance in time grows with the square of the
    intensity."""
    inputs.add_speckle(contrast, 0.0)
