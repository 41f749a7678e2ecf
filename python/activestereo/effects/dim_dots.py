# SPDX-License-Identifier: Apache-2.0
"""Simulates dots that are dim or missing in a part of the pattern."""

from collections.abc import Sequence

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.judging import StartImage
from activestereo.effects.core.moved import engine_effect, tangents

# The grid and the radius of the first trials, in tangents of angles from the projector's axis.
_GRID, _RADIUS = (-0.4, -0.2, 0.0, 0.2, 0.4), 0.15
_BEST = 3


def _left(x: np.ndarray, y: np.ndarray, lost: float, place_x: float, place_y: float, radius: float) -> np.ndarray:
    """Returns the share of the light that is left at tangents (x, y) of angles from the projector's axis."""
    return np.clip(1.0 - lost * np.exp(-0.5 * ((x - place_x) ** 2 + (y - place_y) ** 2) / radius**2), 0.0, None)


def _starts(images: Sequence[StartImage]) -> list[dict[str, float]]:
    """Returns starting values at the places of the pattern whose dots fall short most, by the residual's regression on
    the dots there."""
    scores = {}
    for place_x in _GRID:
        for place_y in _GRID:
            moment = power = 0.0
            for image in images:
                x, y = tangents(image.view)
                lost = (_left(x, y, 1.0, place_x, place_y, _RADIUS) - 1.0) * image.light.projector
                moment += float((lost * image.residual * image.weight).sum())
                power += float((lost * lost * image.weight).sum())
            scores[place_x, place_y] = moment / np.sqrt(power) if power > 0 else 0.0
    best = sorted(scores, key=lambda place: -scores[place])[:_BEST]
    amounts = ({"depth": 0.3}, {"per_k": 0.015})
    return [{"place_x": x, "place_y": y, "radius": _RADIUS, **amount} for x, y in best for amount in amounts]


@engine_effect(
    "dim_dots",
    moves=("pattern",),
    stage=Stage.PROJECTOR,
    family="pattern strength",
    finding="Dots are dim or missing in a part of the pattern",
    source="emitters of an array age one by one, and more so where it is warm; dirt on the projector's window",
    parameters=[
        Parameter("depth", "1", neutral=0.0, low=0.0, high=1.0, typical=0.2),
        Parameter("per_k", "1/K", neutral=0.0, low=0.0, high=0.1, typical=0.01, source="more with each kelvin"),
        Parameter("place_x", "1", neutral=0.1, low=-1.0, high=1.0, typical=0.3, source="tangent from the axis"),
        Parameter("place_y", "1", neutral=0.1, low=-1.0, high=1.0, typical=0.3),
        Parameter("radius", "1", neutral=0.15, low=0.02, high=1.0, typical=0.1, source="a Gaussian's deviation"),
    ],
    starts=_starts,
)
def dim_dots(inputs: EngineInputs, depth: float, per_k: float, place_x: float, place_y: float, radius: float) -> None:
    """Around a place of the pattern the projector's light is weaker, and more so as it warms up."""
    lost = depth + per_k * inputs.warming_k
    if lost != 0.0:
        inputs.dim_pattern(lambda x, y: _left(x, y, lost, place_x, place_y, radius))
