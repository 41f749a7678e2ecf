# SPDX-License-Identifier: Apache-2.0
"""Projector that is dimmer off its axis."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@moves("pattern")
def _engine(inputs: EngineInputs, exponent: float) -> None:
    own = inputs.projector
    if own is None:
        return
    if inputs.pattern is None:
        own.falloff += exponent
        return
    # In the pattern it costs nothing: kuafu's own falloff asks for its slower shading of shaped lights.
    height, width = inputs.pattern.shape
    v, u = np.mgrid[0:height, 0:width]
    y = (v - own.k[1, 2]) / own.k[1, 1]
    x = (u - own.k[0, 2] - own.k[0, 1] * y) / own.k[0, 0]
    inputs.pattern = (inputs.pattern * (1.0 + x * x + y * y) ** (-0.5 * exponent)).astype(np.float32)


@effect(
    "projector_vignetting",
    stage=Stage.PROJECTOR,
    family="projector shading",
    finding="The projector is darker towards its edges",
    source="radiant intensity of a collimated diffractive projector falls with a power of cos",
    parameters=[Parameter("exponent", "1", neutral=0.0, low=0.0, high=12.0, typical=1.5)],
    engine=_engine,
)
def projector_vignetting(light: Light, view: View, exponent: float) -> Light:
    """Projected light falls by cos^exponent of the angle to the projector's axis; ambient light does not."""
    points = view.projector_points()
    distance = np.linalg.norm(points, axis=-1)
    cosine = np.where(distance > 0, points[..., 2] / np.where(distance > 0, distance, 1.0), 1.0)
    return light.scale_projector(np.clip(cosine, 1e-6, 1.0) ** exponent)
