# SPDX-License-Identifier: Apache-2.0
"""Whiteness of a residual: an error that is independent from pixel to pixel is noise; one that neighbours share
indicates a missing effect.
"""

from collections.abc import Sequence

import numpy as np

from activestereo.diagnose.evidence.model_discrepancy import edges
from activestereo.diagnose.evidence.observation import Observation
from activestereo.diagnose.refine.fitter import ImageResidual
from activestereo.diagnose.thresholds import Thresholds


def pose_key(o: Observation) -> tuple[bytes, bool]:
    """The key that images share which stand still together."""
    return o.frame.camera_to_world.tobytes(), o.frame.is_moving


def white_rest(rows: Sequence[ImageResidual], thresholds: Thresholds) -> float:
    """Variance, in noise variances, that stays between repeats of a view and is white over the image, edges left out; 0
    where it is not white.

    Grains are white, and so is the renderer's own Monte Carlo noise; shifted, dimmed or blurred dots are not.
    """
    by_view: dict[object, list[np.ndarray]] = {}
    for o, _, _, r in rows:
        view = pose_key(o), o.frame.exposure_gain, o.frame.projector_power, o.side
        by_view.setdefault(view, []).append(np.where(edges(o), np.nan, r * np.sqrt(o.weight)))
    same, beside, count = 0.0, np.zeros(2), 0
    for first, second, *_ in (group for group in by_view.values() if len(group) > 1):
        same += np.nanmean(first * second)
        beside += [np.nanmean(first[:, 1:] * second[:, :-1]), np.nanmean(first[1:] * second[:-1])]
        count += 1
    white = count > 0 and same > 0 and np.abs(beside).max() < thresholds.white_share * same
    return min(float(same / count), thresholds.largest_white_reduced_chi2) if white else 0.0
