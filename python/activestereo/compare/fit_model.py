# SPDX-License-Identifier: Apache-2.0
"""The nuisances under a model with effects, where the prediction may bend: Gauss-Newton on the same least squares as
nuisances.py."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from activestereo.compare.nuisances import CLIP_MARGIN_SIGMA, Fit, Nuisances, fit_nuisances, solve_bounded

_ROUNDS = 5
_STEP = 1e-3


def fit_under_model(model: Any, observations: Sequence[Any], max_dn: float) -> Fit:
    """observations: [(View, Light that falls on the sensor, measured DN)]. Returns a Fit; ValueError where there is
    nothing to fit."""
    linear = fit_nuisances([(view.frame, light, measured) for view, light, measured in observations], max_dn)
    if not model.effects:
        return linear
    theta, deviation = linear.nuisances.vector(), 0.0
    for _ in range(_ROUNDS):
        gram, moment, squares, used = _normal_equations(model, observations, theta, deviation, max_dn)
        if used == 0:
            raise ValueError("nothing to fit: every pixel of the train frames is clipped under this model")
        # In terms of the nuisances themselves, whose bounds are known: a step to where they end, not beyond.
        theta, inverse, at_bound = solve_bounded(gram, moment + gram @ theta)
        deviation = np.sqrt(squares / used)
    errors = deviation * np.sqrt(np.maximum(np.diag(inverse), 0.0))
    total = sum(measured.size for _, _, measured in observations)
    return Fit(Nuisances(*map(float, theta)), Nuisances(*map(float, errors)), int(used), 1.0 - used / total, at_bound)


def _normal_equations(
    model: Any, observations: Sequence[Any], theta: np.ndarray, deviation: Any, max_dn: float
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Gram matrix, moments, sum of squares and count over pixels predicted away from the range's ends."""
    gram, moment, squares, used = np.zeros((3, 3)), np.zeros(3), 0.0, 0
    for view, light, measured in observations:
        image = model.signal(light, view, Nuisances(*theta))
        columns = []
        for j in range(3):
            moved = theta.copy()
            moved[j] += _STEP * max(abs(theta[j]), 1.0)
            columns.append((model.signal(light, view, Nuisances(*moved)) - image) / (moved[j] - theta[j]))
        keep = (image < max_dn - CLIP_MARGIN_SIGMA * deviation) & (image > 0.0)
        design, residual = np.stack([c[keep] for c in columns]), (measured - image)[keep]
        gram += design @ design.T
        moment += design @ residual
        squares += float(residual @ residual)
        used += residual.size
    return gram, moment, squares, used
