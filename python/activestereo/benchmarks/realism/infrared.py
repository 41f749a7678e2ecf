# SPDX-License-Identifier: Apache-2.0
"""Statistics of infrared pairs on flat, even patches."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from activestereo.benchmarks.realism.patches import PATCH_PX, Patch

Map = NDArray[np.float32]
STATISTICS = ("dots' RMS, DN", "dots' share of light, %", "left-right residual, %", "side peak", "its lag, px")
_BLUR_PX, _BORDER_PX = 6.0, 6
_LEAST_LAG_PX, _LARGEST_LAG_PX = 4.0, 30.0
_MOST_UNEVEN = 0.15  # of the mean: above it a surface has a texture of its own


def statistics(left: Map, right: Map, patch: Patch, black_dn: float) -> dict[str, float] | None:
    """The STATISTICS of a patch with planar disparity; None if the surface has a texture.

    Fine structure is the image less its Gaussian blur of 6 px. The residual is left less right at the true disparity,
    over sqrt 2 and the dots' RMS. The side peak is the largest autocorrelation from 4 to 30 px, with 1 in the
    middle."""
    rows, columns = patch.place
    image = left[rows, columns].astype(np.float32)
    coarse = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
    level = float(image.mean()) - black_dn
    if coarse.std() > _MOST_UNEVEN * image.mean() or level <= 0:
        return None
    fine = image - coarse
    v, u = np.mgrid[rows, columns].astype(np.float32)
    inside = np.s_[_BORDER_PX:-_BORDER_PX, _BORDER_PX:-_BORDER_PX]
    rest = np.inf
    for step in np.arange(-0.4, 0.41, 0.1):  # the eyes' rows are a few tenths of a pixel apart
        seen = cv2.remap(right.astype(np.float32), u - patch.disparity(), v + np.float32(step), cv2.INTER_CUBIC)
        other = seen - cv2.GaussianBlur(seen, (0, 0), _BLUR_PX)
        gain = fine[inside].std() / max(float(other[inside].std()), 1e-6)
        rest = min(rest, float((fine - gain * other)[inside].std()) / float(np.sqrt(1.0 + gain**2)))
    rms = float(fine.std())
    peak, lag = _side_peak(fine)
    values = rms, 100.0 * rms / level, 100.0 * rest / max(rms, 1e-9), peak, lag
    return dict(zip(STATISTICS, values, strict=True))


def _side_peak(fine: Map) -> tuple[float, float]:
    spectrum = np.abs(np.fft.fft2(fine - fine.mean())) ** 2
    correlation = np.fft.fftshift(np.fft.ifft2(spectrum).real)
    correlation /= max(float(correlation.max()), 1e-12)
    middle = PATCH_PX // 2
    y, x = np.mgrid[-middle : PATCH_PX - middle, -middle : PATCH_PX - middle]
    distance = np.hypot(x, y)
    ring = np.where((distance > _LEAST_LAG_PX) & (distance < _LARGEST_LAG_PX), correlation, -1.0)
    at = np.unravel_index(int(ring.argmax()), ring.shape)
    return float(ring[at]), float(distance[at])
