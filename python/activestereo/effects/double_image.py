# SPDX-License-Identifier: Apache-2.0
"""Simulates a pane whose second reflection doubles the image."""

from collections.abc import Sequence

import numpy as np
from scipy import fft
from scipy.ndimage import maximum_filter, shift

from activestereo.effects.core.descriptor import Parameter, Stage, effect
from activestereo.effects.core.judging import StartImage
from activestereo.effects.core.view import View

# The range of shifts that are tried, in pixels. With less than the least shift a second image is a blur.
_MOST_PX, _LEAST_PX, _STARTS = 20, 1.5, 3


def _starts(images: Sequence[StartImage]) -> list[dict[str, float]]:
    """Returns {fraction, shift_u_px, shift_v_px} of the best few peaks. At every shift of whole pixels, the residual is
    regressed on the shifted image beside the image itself (Schur's complement), by Fourier transforms."""
    of_moment, of_square, of_both, of_own, own = (np.zeros((2 * _MOST_PX + 1,) * 2) for _ in range(5))
    for o in images:
        image = o.expected * (o.weight > 0)
        of_moment += _correlated(o.weight * o.residual, image)
        of_square += _correlated(o.weight, image**2)
        of_both += _correlated(o.weight * image, image)
        of_own += float((o.weight * image * o.residual).sum())
        own += float((o.weight * image**2).sum())
    left, square = of_moment - of_both * of_own / own, of_square - of_both**2 / own
    v, u = np.mgrid[-_MOST_PX : _MOST_PX + 1, -_MOST_PX : _MOST_PX + 1]
    fraction = np.maximum(left, 0.0) / np.maximum(square, 1e-9 * own)
    gain = np.where(np.hypot(u, v) < _LEAST_PX, 0.0, fraction * left)
    peaks = np.flatnonzero((gain > 0.0) & (gain == maximum_filter(gain, 3)))
    best = peaks[np.argsort(-gain.ravel()[peaks])][:_STARTS]
    return [
        {"fraction": float(fraction.flat[i]), "shift_u_px": float(u.flat[i]), "shift_v_px": float(v.flat[i])}
        for i in best
    ] or [{}]


def _correlated(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Returns sums of `a` times `b` shifted down and right, [row][column]; shifts run from -20 to 20 pixels
    each way."""
    shape = [fft.next_fast_len(n + _MOST_PX, real=True) for n in a.shape]
    whole = fft.irfft2(fft.rfft2(a, shape) * fft.rfft2(b, shape).conj(), shape)
    return np.roll(whole, (_MOST_PX, _MOST_PX), (0, 1))[: 2 * _MOST_PX + 1, : 2 * _MOST_PX + 1]


@effect(
    "double_image",
    stage=Stage.OPTICS,
    family="glare",
    finding="A pane before the cameras doubles the images",
    source="Fresnel: light that both faces of a pane reflect leaves it 0.2 % (glass) to 10 % (coated) as bright, aside "
    "by twice the angle of its wedge",
    starts=_starts,
    parameters=[
        Parameter("fraction", "1", neutral=0.0, low=0.0, high=0.5, typical=0.03),
        Parameter("shift_u_px", "px", neutral=3.0, low=-20.0, high=20.0, typical=3.0, source="aside of the image"),
        Parameter("shift_v_px", "px", neutral=0.0, low=-20.0, high=20.0, typical=3.0, source="below the image"),
    ],
    image_only="kuafu's optics end at the lens",
)
def double_image(image: np.ndarray, view: View, fraction: float, shift_u_px: float, shift_v_px: float) -> np.ndarray:
    """A weaker image lies beside the image."""
    if fraction == 0.0:
        return image
    return image + fraction * shift(image, (*(0,) * (image.ndim - 2), shift_v_px, shift_u_px), order=1)
