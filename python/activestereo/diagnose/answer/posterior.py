# SPDX-License-Identifier: Apache-2.0
"""The belief in each effect, and in its parameters, that a diagnosis ends with."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.score.intervals import Z90, Interval


@dataclass(frozen=True)
class EffectPosterior:
    """probability: of being what the images lack. parameters: values with their 90 % intervals; a choice of surfaces
    and a parameter whose interval is unknown have none."""

    probability: float
    parameters: dict[str, Interval]

    def draws(self, count: int, seed: int = 0) -> dict[str, NDArray[np.float64]]:
        """{parameter: `count` values}, normal with the interval's width, cut at its parameter's range where the
        interval ends there; parameters are drawn apart from each other."""
        rng = np.random.default_rng(seed)
        return {name: _drawn(rng, p, count) for name, p in self.parameters.items()}


def posterior_of(result: Mapping[str, Any]) -> dict[str, EffectPosterior]:
    """{effect: its EffectPosterior} of diagnose.json's contents, in the ranking's order."""
    return {
        entry["effect"]: EffectPosterior(entry["confidence"], _intervals(entry["parameters"]))
        for entry in result["ranking"]
    }


def _intervals(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, Interval]:
    return {
        name: Interval(p["value"], p["low"], p["high"], p["unit"])
        for name, p in parameters.items()
        if "materials" not in p and p["low"] is not None and p["high"] is not None
    }


def _drawn(rng: np.random.Generator, p: Interval, count: int) -> NDArray[np.float64]:
    """The wider side of the interval gives the deviation: the other one may end at the parameter's range."""
    below, above = p.value - p.low, p.high - p.value
    half = max(below, above)
    values = p.value + half / Z90 * rng.standard_normal(count)
    least = p.low if below < half else -np.inf
    most = p.high if above < half else np.inf
    return np.clip(values, least, most)
