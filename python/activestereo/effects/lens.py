# SPDX-License-Identifier: Apache-2.0
"""Effects of lenses, panes before them, and the blur of rectification."""

from collections.abc import Sequence

import numpy as np
from scipy import fft
from scipy.ndimage import maximum_filter, shift

from activestereo.effects.core.descriptor import Parameter, Stage, StartImage, effect
from activestereo.effects.core.engine import EngineInputs
from activestereo.effects.core.light import Light
from activestereo.effects.core.moved import engine_effect
from activestereo.effects.core.view import View


@engine_effect(
    stage=Stage.CAMERA, family="camera blur", moves=("optics.psf_sigma_px", "optics.psf_corner_sigma_px"),
    finding="The camera's lens blurs the images",
    source="Gaussian line spread; visible dot sigma 0.8-1.2 px on D4xx frames",
    parameters=[
        Parameter("sigma_px", "px", high=3.0, typical=0.5),
        Parameter("corner_sigma_px", "px", high=4.0, typical=0.6, source="field curvature: grows with radius squared"),
    ],
)  # fmt: skip
def lens_psf(inputs: EngineInputs, sigma_px: float, corner_sigma_px: float) -> None:
    """A Gaussian blurs all light. Its width has a constant part and a part that grows towards the corners."""
    for side in inputs.sides:
        side.optics.psf_sigma_px = np.hypot(side.optics.psf_sigma_px, sigma_px)
        side.optics.psf_corner_sigma_px = np.hypot(side.optics.psf_corner_sigma_px, corner_sigma_px)


@engine_effect(
    stage=Stage.CAMERA, family="camera blur", moves=("left.optics.psf_sigma_px", "right.optics.psf_sigma_px"),
    finding="One camera is out of focus",
    source="lenses of a pair are focused one by one; a knock or warmth moves one of them",
    parameters=[
        Parameter("sigma_px", "px", low=-3.0, high=3.0, typical=0.4, source="> 0: of the right camera, < 0: left"),
    ],
)  # fmt: skip
def focus_mismatch(inputs: EngineInputs, sigma_px: float) -> None:
    """A Gaussian blurs one camera's images alone."""
    side = inputs.right if sigma_px > 0 else inputs.left
    side.optics.psf_sigma_px = np.hypot(side.optics.psf_sigma_px, sigma_px)


@effect(
    stage=Stage.CAMERA, family="camera blur",
    finding="Rectification blurs the images",
    source="bilinear interpolation: neighbouring noise correlates by 0.28 in D4xx frames",
    image_only="kuafu's point spread is a Gaussian, which two weighted pixels are not",
    parameters=[
        Parameter("phase_u_px", "px", high=1.0, typical=0.4),
        Parameter("phase_v_px", "px", high=1.0, typical=0.4),
    ],
)  # fmt: skip
def rectification_resampling(light: Light, view: View, phase_u_px: float, phase_v_px: float) -> Light:
    """The sensor's pixels lie phase_u_px to the right of the rectified ones and phase_v_px below. A rectified pixel is
    the weighted mean of the two nearest along columns and along rows. The mean loses detail and moves nothing."""
    if phase_u_px == 0.0 and phase_v_px == 0.0:
        return light
    along_u, along_v = (((phase, 1.0 - phase), (phase - 1.0, phase)) for phase in (phase_u_px, phase_v_px))
    return light.filtered(lambda images: images.shifted_sum(along_u, along_v))


@engine_effect(
    stage=Stage.OPTICS, family="lens shading", moves=("optics.vignetting_exponent",),
    finding="The images are darker towards their corners",
    source="cos^4 law of a thin lens: Born and Wolf, Principles of Optics, 4.8.1",
    parameters=[Parameter("exponent", "1", high=8.0, typical=1.5, source="4 = thin lens; D4xx corners 0.35-0.45")],
)  # fmt: skip
def vignetting(inputs: EngineInputs, exponent: float) -> None:
    """All light falls by cos^exponent of the angle to the optical axis."""
    for side in inputs.sides:
        side.optics.vignetting_exponent += exponent


@engine_effect(
    stage=Stage.OPTICS, family="glare", moves=("optics.veiling_glare_fraction",),
    finding="Stray light veils the images",
    source="ISO 9358 veiling glare index",
    parameters=[Parameter("fraction", "1", high=0.8, typical=0.04)],
)  # fmt: skip
def veiling_glare(inputs: EngineInputs, fraction: float) -> None:
    """The lens spreads a fraction of all light evenly over the image."""
    for side in inputs.sides:
        side.optics.veiling_glare_fraction = 1.0 - (1.0 - side.optics.veiling_glare_fraction) * (1.0 - fraction)


@effect(
    stage=Stage.OPTICS, family="glare",
    finding="A pane before the cameras adds mirrored ghosts to the images",
    source="Fresnel: an uncoated face reflects 4 %, an imager 10 to 20 %; Hullin et al. 2011, Physically-based "
           "real-time lens flare rendering, section 3",
    image_only="kuafu's optics end at the lens",
    parameters=[Parameter("fraction", "1", high=0.5, typical=0.02)],
)  # fmt: skip
def lens_ghost(image: np.ndarray, view: View, fraction: float) -> np.ndarray:
    """A pane square to the axis sends the imager's reflection back. The image gets a ghost, point-mirrored at the
    principal point."""
    if fraction == 0.0:
        return image
    height, width = view.shape
    middle = 2.0 * view.K[1, 2] - (height - 1), 2.0 * view.K[0, 2] - (width - 1)
    return image + fraction * shift(image[..., ::-1, ::-1], (*(0,) * (image.ndim - 2), *middle), order=1)


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
    stage=Stage.OPTICS, family="glare", starts=_starts,
    finding="A pane before the cameras doubles the images",
    source="Fresnel: light that both faces of a pane reflect leaves it 0.2 % (glass) to 10 % (coated) as bright, aside "
           "by twice the angle of its wedge",
    image_only="kuafu's optics end at the lens",
    parameters=[
        Parameter("fraction", "1", high=0.5, typical=0.03),
        Parameter("shift_u_px", "px", neutral=3.0, low=-20.0, high=20.0, typical=3.0, source="aside of the image"),
        Parameter("shift_v_px", "px", low=-20.0, high=20.0, typical=3.0, source="below the image"),
    ],
)  # fmt: skip
def double_image(image: np.ndarray, view: View, fraction: float, shift_u_px: float, shift_v_px: float) -> np.ndarray:
    """A weaker image lies beside the image."""
    if fraction == 0.0:
        return image
    return image + fraction * shift(image, (*(0,) * (image.ndim - 2), shift_v_px, shift_u_px), order=1)
