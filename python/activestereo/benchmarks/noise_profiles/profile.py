# SPDX-License-Identifier: Apache-2.0
"""The base of all noise models, and how one is fitted."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from activestereo.benchmarks.noise_profiles.distance import distance
from activestereo.benchmarks.noise_profiles.rooms import Views

_BAND, _PERIOD = 8, 64
_MOST_EVALUATIONS = 120


@dataclass(frozen=True)
class Profile(ABC):
    """A simulator's model of noise, with its parameters. One that is made without arguments is its default."""

    FILE: ClassVar[str]
    LACKS: ClassVar[tuple[str, ...]]  # properties without a parameter in the model, one line each
    # Parameters that are fitted: {name: (low, high, start)}.
    FITTED: ClassVar[dict[str, tuple[float, float, float]]]

    @abstractmethod
    def apply(self, views: Views, random: np.random.Generator) -> NDArray[np.float32]:
        """Depth of the views as the simulator gives it, [rooms, height, width] metres, 0 = none."""

    @classmethod
    @abstractmethod
    def known(cls, views: Views) -> Profile:
        """The profile with the parameters that need no fit: range, geometry."""

    @abstractmethod
    def file_text(self, views: Views) -> str:
        """The simulator's own file."""

    @property
    def parameters(self) -> dict[str, float]:
        return asdict(self)


def clipped(truth_m: NDArray[np.float32], noisy_m: NDArray[Any], near_m: float, far_m: float) -> NDArray[np.float32]:
    """noisy_m, positive, if the true depth lies within a range, else 0."""
    is_kept = (truth_m >= near_m) & (truth_m <= far_m)
    return np.where(is_kept, np.maximum(noisy_m, 1e-3), 0.0).astype(np.float32)


def fitted(kind: type[Profile], views: Views) -> Profile:
    """The model nearest to the sensor's measurements, by distance()'s total."""
    rows, start = views.bands(_BAND, _PERIOD), kind.known(views)
    low, high, first = (np.array(values) for values in zip(*kind.FITTED.values(), strict=True))

    def made(unit: NDArray[np.float64]) -> Profile:
        values = low + np.clip(unit, 0.0, 1.0) * (high - low)
        return replace(start, **dict(zip(kind.FITTED, map(float, values), strict=True)))

    def loss(unit: NDArray[np.float64]) -> float:
        outside = float(np.sum(np.abs(unit - np.clip(unit, 0.0, 1.0))))
        return distance(rows, made(unit).apply(rows, np.random.default_rng(0))).total + outside

    begin = (first - low) / (high - low)
    simplex = np.vstack([begin, begin + 0.3 * np.where(begin < 0.5, 1.0, -1.0) * np.eye(len(begin))])
    options = {"initial_simplex": simplex, "maxfev": _MOST_EVALUATIONS, "xatol": 1e-3, "fatol": 1e-5}
    return made(minimize(loss, begin, method="Nelder-Mead", options=options).x)
