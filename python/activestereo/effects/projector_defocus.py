"""Dots that blur away from the projector's focus."""

import numpy as np

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.dots import DotView

_LEVELS = 6


@effect(
    "projector_defocus",
    stage=Stage.PROJECTOR,
    family="projector blur",
    source="thin lens: angular blur = aperture x |1/z - 1/z_focus|",
    parameters=[
        Parameter("aperture_px_m", "px m", neutral=0.0, low=0.0, high=12.0, typical=2.0, source="aperture times focal length in pattern pixels"),
        Parameter("focus_m", "m", neutral=1.0, low=0.2, high=5.0, typical=0.5),
    ],
)
def projector_defocus(light, view, aperture_px_m, focus_m):
    """Each dot becomes a disc whose diameter in pattern pixels is aperture x |1/z - 1/focus|; ambient edges stay sharp."""
    if aperture_px_m == 0.0:
        return light
    dots = DotView(view)
    z = np.where(dots.lit, dots.z, focus_m)
    diameter = aperture_px_m * np.abs(1.0 / z - 1.0 / focus_m)
    nominal = dots.mean(view.pattern)
    levels = np.linspace(0.0, max(float(diameter.max()), 1e-9), _LEVELS)
    after = np.zeros_like(nominal)
    for i, level in enumerate(levels):
        weight = np.maximum(0.0, 1.0 - np.abs(diameter / levels[-1] * (_LEVELS - 1) - i))
        after += weight * (nominal if i == 0 else dots.mean(_disc_blur(view.pattern, level)))
    return dots.change(light, nominal, after)


def _disc_blur(pattern, diameter_px):
    """Mean over a disc, by the transfer function of its own supersampled stamp."""
    radius = diameter_px / 2
    reach, fine = int(np.ceil(radius)) + 1, 8
    offsets = (np.arange((2 * reach + 1) * fine) + 0.5) / fine - reach - 0.5
    inside = (offsets[:, None] ** 2 + offsets[None] ** 2 <= radius**2).astype(np.float64)
    stamp = inside.reshape(2 * reach + 1, fine, 2 * reach + 1, fine).sum(axis=(1, 3))
    if stamp.sum() == 0:
        return pattern
    shape = [n + 2 * reach for n in pattern.shape]
    product = np.fft.rfft2(pattern, shape) * np.fft.rfft2(stamp / stamp.sum(), shape)
    blurred = np.fft.irfft2(product, shape)
    return blurred[reach : reach + pattern.shape[0], reach : reach + pattern.shape[1]]
