# SPDX-License-Identifier: Apache-2.0
"""Simulates the bilinear resampling of rectified images."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.light import Light
from activestereo.effects.core.view import View


@effect(
    "rectification_resampling",
    stage=Stage.CAMERA,
    family="camera blur",
    finding="Rectification blurs the images",
    source="bilinear interpolation: neighbouring noise correlates by 0.28 in D4xx frames",
    parameters=[
        Parameter("phase_u_px", "px", neutral=0.0, low=0.0, high=1.0, typical=0.4),
        Parameter("phase_v_px", "px", neutral=0.0, low=0.0, high=1.0, typical=0.4),
    ],
    image_only="kuafu's point spread is a Gaussian, which two weighted pixels are not",
)
def rectification_resampling(light: Light, view: View, phase_u_px: float, phase_v_px: float) -> Light:
    """The sensor's pixels lie phase_u_px to the right of the rectified ones and phase_v_px below: each of those is the
    weighted mean of the two nearest, along columns and along rows. Detail is lost, place is not."""
    if phase_u_px == 0.0 and phase_v_px == 0.0:
        return light
    return light.shifted_sum(*(((phase, 1.0 - phase), (phase - 1.0, phase)) for phase in (phase_u_px, phase_v_px)))
