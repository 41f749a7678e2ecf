"""Bilinear resampling on the way to rectified images."""

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.resample import sample


@effect(
    "rectification_resampling",
    stage=Stage.OPTICS,
    family="camera blur",
    source="bilinear interpolation: neighbouring noise correlates by 0.28 in D4xx frames",
    parameters=[
        Parameter("phase_u_px", "px", neutral=0.0, low=0.0, high=1.0, typical=0.4),
        Parameter("phase_v_px", "px", neutral=0.0, low=0.0, high=1.0, typical=0.4),
    ],
)
def rectification_resampling(image, view, phase_u_px, phase_v_px):
    """Images are shifted by a fraction of a pixel with bilinear weights and shifted back by calibration: detail is lost, place is not."""
    if phase_u_px == 0.0 and phase_v_px == 0.0:
        return image
    u, v = view.pixels()
    forth = sample(image, u + phase_u_px, v + phase_v_px, order=1)
    return sample(forth, u - phase_u_px, v - phase_v_px, order=3)
