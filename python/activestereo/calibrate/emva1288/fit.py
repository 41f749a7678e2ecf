# SPDX-License-Identifier: Apache-2.0
"""Linear least squares whose errors hold: values scatter by their known errors, and by as much more as they show."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from activestereo.model import Quantity

# Both tails of a 90 % interval, and half of its width in standard deviations.
_TAIL = 0.95
DEVIATIONS = float(norm.ppf(_TAIL))


@dataclass(frozen=True)
class WeightedFit:
    """values: of the columns, with their covariance; quantile: deviations of half a 90 % interval, Student's where the
    scatter was estimated. bic: Schwarz' criterion, lower is better."""

    values: np.ndarray
    covariance: np.ndarray
    quantile: float
    bic: float

    def error(self, place: int) -> float:
        """A value's standard deviation."""
        return float(np.sqrt(max(self.covariance[place, place], 0.0)))

    def nearby(self) -> list[np.ndarray]:
        """Values one standard deviation away, one set for each independent direction."""
        squares, directions = np.linalg.eigh(self.covariance)
        return [self.values + step for step in (directions * np.sqrt(np.maximum(squares, 0.0))).T]

    def quantity(self, place: int, unit: str, source: str) -> Quantity:
        """A value with its 90 % interval."""
        value, half = float(self.values[place]), self.quantile * self.error(place)
        return Quantity(value, value - half, value + half, unit, source)


def fit_weighted(columns: np.ndarray, values: np.ndarray, errors: np.ndarray, scale: Any = 1.0) -> WeightedFit:
    """columns [n][k] @ values [k]. errors: known standard deviations, [n]; scale: what further scatter is proportional
    to. The scatter is the one at which chi square is its expectation, none where it is below that."""
    degrees = len(values) - columns.shape[1]
    # Columns of one size keep the normal equations well conditioned.
    size = np.linalg.norm(columns, axis=0)

    def solve(scatter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        deviation = np.sqrt(errors**2 + (scatter * scale) ** 2)
        design = columns / size / deviation[:, None]
        inverse = np.linalg.pinv(design)
        found = inverse @ (values / deviation)
        return found, inverse @ inverse.T, values / deviation - design @ found, deviation

    def excess(scatter: float) -> float:
        rest = solve(scatter)[2]
        return float(rest @ rest) - degrees

    scatter = 0.0
    if degrees > 0 and excess(0.0) > 0.0:
        most = float(np.max(np.abs(values / scale)))
        scatter = float(brentq(excess, 0.0, most, xtol=1e-9 * most)) if excess(most) < 0.0 else most
    found, covariance, rest, deviation = solve(scatter)
    bic = float(2.0 * np.log(deviation).sum() + rest @ rest + columns.shape[1] * np.log(len(values)))
    quantile = float(t.ppf(_TAIL, degrees) if scatter > 0.0 else DEVIATIONS)
    return WeightedFit(found / size, covariance / np.outer(size, size), quantile, bic)
