# SPDX-License-Identifier: Apache-2.0
"""Simulates an imager that does not stand square behind its lens."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.engine import rotation
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@effect(
    "imager_tilt",
    stage=Stage.CAMERA,
    family="camera geometry",
    finding="The imagers stand askew behind their lenses",
    source="Scheimpflug model: Louhichi et al. 2007, Self-calibration of Scheimpflug cameras; OpenCV's tau_x, tau_y; "
    "camera modules are assembled to 0.1 to 0.5 degrees",
    parameters=[
        Parameter("tau_x_rad", "rad", neutral=0.0, low=-0.1, high=0.1, typical=0.005),
        Parameter("tau_y_rad", "rad", neutral=0.0, low=-0.1, high=0.1, typical=0.005),
    ],
    image_only="kuafu's imagers stand square behind their lenses",
)
def imager_tilt(light: Light, view: View, tau_x_rad: float, tau_y_rad: float) -> Light:
    """The imager is turned about its x axis, then about its y axis, around the principal point: the image of a plane is
    that of a pinhole under a homography, which keeps straight lines straight."""
    if tau_x_rad == 0.0 and tau_y_rad == 0.0:
        return light
    turn = rotation((0.0, 1.0, 0.0), tau_y_rad) @ rotation((1.0, 0.0, 0.0), tau_x_rad)
    x, y = view.rays()
    # `place` is the point (x, y) of the tilted imager behind the lens, in focal lengths. Its ray meets the plane z = 1
    # at place / z.
    place = turn @ np.stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + np.array([[0.0], [0.0], [1.0]])
    return light.warped(*view.to_pixels(*(place[:2] / place[2]).reshape(2, *x.shape)))
