# SPDX-License-Identifier: Apache-2.0
"""Simulates a lens or cover glass whose faces are not parallel."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View

_STEPS = 6  # fixed-point iterations, each of which contracts by 2 |s| r


@effect(
    "thin_prism",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="A wedge of glass bends the images",
    source="Weng, Cohen and Herniou 1992, Camera calibration with distortion models, eq. 10; OpenCV's s1, s3",
    parameters=[
        Parameter("s1", "1", neutral=0.0, low=-0.03, high=0.03, typical=0.002),
        Parameter("s3", "1", neutral=0.0, low=-0.03, high=0.03, typical=0.002),
    ],
    image_only="kuafu's lens has radial and tangential terms",
)
def thin_prism(light: Light, view: View, s1: float, s3: float) -> Light:
    """The image point (x, y), in focal lengths, moves by (s1, s3) r^2 in both cameras."""
    if s1 == 0.0 and s3 == 0.0:
        return light
    drawn_x, drawn_y = view.rays()
    x, y = drawn_x, drawn_y
    for _ in range(_STEPS):
        r2 = x * x + y * y
        x, y = drawn_x - s1 * r2, drawn_y - s3 * r2
    return light.warped(*view.to_pixels(x, y))
