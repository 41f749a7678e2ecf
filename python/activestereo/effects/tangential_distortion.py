# SPDX-License-Identifier: Apache-2.0
"""Simulates lens elements that are off their common axis."""

from activestereo.effects.core.descriptor import Parameter, Stage
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.moved import engine_effect


@engine_effect(
    "tangential_distortion",
    moves=("camera.distortion",),
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The lenses' elements are off their axis",
    source="Brown 1966, Decentering distortion of lenses; OpenCV's p1, p2; 1e-4 to 1e-3 on calibrated D4xx modules",
    parameters=[
        Parameter("p1", "1", neutral=0.0, low=-0.02, high=0.02, typical=0.001),
        Parameter("p2", "1", neutral=0.0, low=-0.02, high=0.02, typical=0.001),
    ],
)
def tangential_distortion(inputs: EngineInputs, p1: float, p2: float) -> None:
    """The image point (x, y), in focal lengths, moves by (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y) in
    both cameras: a side of the image is stretched, the other one shrinks."""
    for side in inputs.sides:
        side.add_distortion(p1=p1, p2=p2)
