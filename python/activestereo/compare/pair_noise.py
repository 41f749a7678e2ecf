# SPDX-License-Identifier: Apache-2.0
"""The noise of frames that have no repeats, from the difference of their own two cameras.

Where the image is smooth, left and right show the same light at the scene's depth: half of the variance of their
difference is one camera's noise. Speckle, which differs between the cameras, is in it; what the scene's depth gets
wrong adds to it, so it is an upper bound.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_gradient_magnitude

from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.camera_warp import warp_between
from activestereo.compare.noise import NoiseModel, fit_terms
from activestereo.effects.core.view import View

_BINS = 24
_LEAST_PIXELS = 200
_SMOOTHEST = 0.25  # share of a bin's pixels that is taken: those with the least slope
_LOCAL_MEAN_PX = 4.0  # gain and offset between the cameras go with the local mean of the difference
_TRIM = 4.0  # deviations

Pair = tuple[View, View, NDArray[np.generic], NDArray[np.generic]]


def pair_noise_model(pairs: Iterable[Pair], black_dn: float) -> NoiseModel | None:
    """A NoiseModel from (left view, right view, left DN, right DN) of frames; None where too little is smooth."""
    rows = [row for pair in pairs for row in _rows(*pair)]
    if not rows:
        return None
    gain, mean, variance, weight = np.array(rows).T
    terms = np.stack([np.ones_like(mean), gain * np.maximum(mean - black_dn, 0.0)], axis=1)
    (offset, shot), _ = fit_terms(terms, variance, weight)
    return NoiseModel(max(offset, ROUNDING_VARIANCE), shot, 0.0, float(black_dn))


def _rows(left: View, right: View, left_dn: NDArray, right_dn: NDArray) -> list[tuple[float, float, float, float]]:
    """(gain, mean, variance of one camera, weight) by brightness."""
    warp = warp_between(left, right)
    image, there = np.asarray(left_dn, np.float64), warp.read(right_dn)
    rest = image - there
    rest = rest - gaussian_filter(rest, _LOCAL_MEAN_PX)
    kept = 1.0 - 1.0 / (2.0 * np.pi * _LOCAL_MEAN_PX**2)  # of the variance, by first order, without the local mean
    one_side = rest**2 / (kept * (1.0 + warp.interpolation_variance))
    slope = gaussian_gradient_magnitude(image, 1.0) + gaussian_gradient_magnitude(there, 1.0)
    usable = warp.seen & (image > 0) & (np.maximum(image, there) < left.max_dn - 1)
    if left.known is not None:
        usable &= left.known
    level = gaussian_filter(image, 1.0)
    if usable.sum() < _LEAST_PIXELS:
        return []
    edges = np.unique(np.quantile(level[usable], np.linspace(0.0, 1.0, _BINS + 1)))
    rows = []
    for low, high in zip(edges, edges[1:], strict=False):
        inside = usable & (level >= low) & (level < high)
        if inside.sum() < _LEAST_PIXELS:
            continue
        smooth = inside & (slope <= np.quantile(slope[inside], _SMOOTHEST))
        squares = one_side[smooth]
        limit = _TRIM**2 * max(np.median(squares) / 0.455, ROUNDING_VARIANCE)  # 0.455: median of chi square, 1 dof
        variance = float(squares[squares <= limit].mean())
        rows.append(
            (left.frame.gain, float(level[smooth].mean()), variance, float(np.sqrt(squares.size) / max(variance, 1e-3)))
        )
    return rows
