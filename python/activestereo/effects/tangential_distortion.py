# SPDX-License-Identifier: Apache-2.0
"""Lens elements that are off their common axis."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import EngineInputs, moves
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@moves("camera.distortion")
def _engine(inputs: EngineInputs, p1: float, p2: float) -> None:
    for side in inputs.sides:
        side.add_distortion(p1=p1, p2=p2)


@effect(
    "tangential_distortion",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The lenses' elements are off their axis",
    source="Brown 1966, Decentering distortion of lenses; OpenCV's p1, p2; 1e-4 to 1e-3 on calibrated D4xx modules",
    parameters=[
        Parameter("p1", "1", neutral=0.0, low=-0.02, high=0.02, typical=0.001),
        Parameter("p2", "1", neutral=0.0, low=-0.02, high=0.02, typical=0.001),
    ],
    engine=_engine,
)
def tangential_distortion(light: Light, view: View, p1: float, p2: float) -> Light:
    """The image point (x, y), in focal lengths, moves by (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y) in
    both cameras: a side of the image is stretched, the other one shrinks."""
    if p1 == 0.0 and p2 == 0.0:
        return light
    return light.warped(*view.through_lens((0.0, 0.0, p1, p2, 0.0)))
