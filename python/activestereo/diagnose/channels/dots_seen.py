# SPDX-License-Identifier: Apache-2.0
"""The share of the variance of the dots' gains that an estimate by cells of the pattern recovers: neighbouring dots
share pixels and cells, so it is below 1.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt, maximum_filter

from activestereo.diagnose.refine import ImageResidual
from activestereo.effects.core.dots import DotView

# Of the pattern: dots are this far apart at least, and no dimmer than this share of the brightest.
_DOT_PX, _DIMMEST = 5, 0.1
_SPREAD, _SEED = 0.1, 13
# An estimate that sees less of it tells nothing, and is not blown up further.
_LEAST = 0.1


def dots_seen(train: Sequence[ImageResidual], variance_of: Callable[[list[np.ndarray]], float]) -> float:
    """Estimated over true variance of gains that are drawn for every dot by itself.

    variance_of: the estimate from residuals of the train images (the method of simulated moments: McFadden 1989).
    """
    drawn = None
    residuals = []
    for o, _, dots, _ in train:
        if drawn is None:
            drawn = o.view.pattern * _gains(o.view.pattern, o.view.seed)
        view = DotView.of(o.view)
        nominal = view.nominal()
        residuals.append(
            dots * np.where(nominal > 0, view.mean(drawn) / np.where(nominal > 0, nominal, 1.0) - 1.0, 0.0)
        )
    return max(variance_of(residuals) / _SPREAD**2, _LEAST)


def _gains(pattern: np.ndarray, seed: int) -> np.ndarray:
    """1 and a deviation of _SPREAD, one draw for the cell of every dot."""
    peaks = (pattern == maximum_filter(pattern, _DOT_PX)) & (pattern > _DIMMEST * pattern.max())
    draws = np.zeros(pattern.shape)
    draws[peaks] = np.random.Generator(np.random.PCG64([_SEED, seed])).normal(1.0, _SPREAD, int(peaks.sum()))
    nearest = distance_transform_edt(~peaks, return_distances=False, return_indices=True)
    return draws[tuple(nearest)]
