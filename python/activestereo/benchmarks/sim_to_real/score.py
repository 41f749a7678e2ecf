# SPDX-License-Identifier: Apache-2.0
"""Agreement of two worlds on the quality of methods: the correlation of their scores, and the gap between them.

Intervals come from resampling views, the same ones in both worlds (Efron and Tibshirani, An Introduction to the
Bootstrap, 1993, ch. 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

_DRAWS, _LEVEL = 2000, 0.95


@dataclass(frozen=True)
class Figure:
    """A value with its 95 % interval. NaN: undefined, because all scores of a world are alike."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Agreement:
    """pearson, spearman: correlation over models; gap: mean absolute difference of their scores."""

    pearson: Figure
    spearman: Figure
    gap: Figure


def pearson(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """[...] of scores [..., models]; NaN where all of a or all of b are alike."""
    a, b = a - a.mean(axis=-1, keepdims=True), b - b.mean(axis=-1, keepdims=True)
    scale = np.sqrt((a * a).sum(axis=-1) * (b * b).sum(axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(scale > 1e-12, (a * b).sum(axis=-1) / scale, np.nan))


def spearman(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """pearson() of the ranks; equal scores share their middle rank."""
    return pearson(rankdata(a, axis=-1), rankdata(b, axis=-1))


def mean_gap(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """[...] of scores [..., models]."""
    return np.asarray(np.abs(a - b).mean(axis=-1))


def agreement(
    simulated: NDArray[np.bool_],
    real: NDArray[np.bool_],
    seed: int = 0,
    known: tuple[Sequence[float], Sequence[float]] = ((), ()),
) -> Agreement:
    """The agreement of successes [models, views] in two worlds. known: scores of further models in both, without views
    to resample. Raises ValueError if the two differ in models or views."""
    if simulated.shape != real.shape or simulated.ndim != 2 or not simulated.size:
        raise ValueError(f"successes of both worlds are [models, views], not {simulated.shape} and {real.shape}")
    views = simulated.shape[1]
    drawn = np.random.default_rng(seed).multinomial(views, np.full(views, 1.0 / views), _DRAWS) / views
    scores = []
    for own, more in zip((simulated, real), known, strict=True):
        draws = drawn @ own.T.astype(np.float64)
        fixed = np.broadcast_to(np.array(more, np.float64), (_DRAWS, len(more)))
        scores.append((np.append(own.mean(axis=1), more), np.concatenate([draws, fixed], axis=1)))
    figures = []
    for measure in (pearson, spearman, mean_gap):
        value = float(measure(*(own for own, _ in scores)))
        draws = measure(*(draw for _, draw in scores))
        draws = draws[np.isfinite(draws)]
        tail = 50.0 * (1.0 - _LEVEL)
        low, high = np.percentile(draws, (tail, 100.0 - tail)) if draws.size else (np.nan, np.nan)
        figures.append(Figure(value, float(low), float(high)))
    return Agreement(*figures)
