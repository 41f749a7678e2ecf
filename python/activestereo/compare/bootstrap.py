# SPDX-License-Identifier: Apache-2.0
"""Computes intervals and tests for pixels that are not independent: it resamples whole blocks of the image, never
single pixels.

Efron and Tibshirani, An Introduction to the Bootstrap, 1993, ch. 8 (blocks); Benjamini and Yekutieli, Annals of
Statistics 29, 2001.
"""

from collections.abc import Sequence

import numpy as np

LEVEL = 0.95


class BlockBootstrap:
    """Draws Poisson(1) weights for `groups` groups of blocks, float32 [draws][groups], and uses the same ones for every
    statistic."""

    def __init__(self, groups: int, draws: int = 4000, seed: int = 0) -> None:
        rng = np.random.Generator(np.random.Philox(seed))
        self.weights = rng.poisson(1.0, (draws, groups)).astype(np.float32)

    def ratios(self, numerators: Sequence[np.ndarray], denominator: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Returns for each numerator: (sum(numerator) / sum(denominator) over groups, [bins], and its draws
        [draws][bins]); NaN where the denominator is 0. numerators, denominator: arrays [groups][bins]."""
        columns = [np.asarray(sums, dtype=np.float32) for sums in (denominator, *numerators)]
        drawn = np.split(self.weights @ np.concatenate(columns, axis=1), len(columns), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return [(n.sum(0) / denominator.sum(0), d / drawn[0]) for n, d in zip(numerators, drawn[1:], strict=True)]


def interval(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (low, high), the bounds of the central 95 % of draws [draws][...]."""
    tail = 50.0 * (1.0 - LEVEL)
    low, high = np.nanpercentile(draws, (tail, 100.0 - tail), axis=0)
    return low, high


def max_t(value: np.ndarray, draws: np.ndarray) -> tuple[float, np.ndarray]:
    """Returns (largest |t| of value [bins] against 0, its draws under the hypothesis that all values are 0). draws:
    [draws][bins]."""
    deviation = np.nanstd(draws, axis=0)
    usable = np.isfinite(value) & np.isfinite(draws).all(axis=0) & (deviation > 0)
    if not usable.any():
        return 0.0, np.zeros(len(draws))
    value, draws, deviation = value[usable], draws[:, usable], deviation[usable]
    return float(np.max(np.abs(value) / deviation)), np.max(np.abs(draws - value) / deviation, axis=1)


def benjamini_yekutieli(p_values: Sequence[float] | np.ndarray) -> np.ndarray:
    """Returns the tests' q-values: rejecting q <= alpha keeps the false discovery rate below alpha, however the tests
    depend on each other."""
    p = np.asarray(p_values, dtype=np.float64)
    if p.size == 0:
        return p
    order = np.argsort(p)
    ranks = np.arange(1, p.size + 1)
    scaled = p[order] * p.size * (1.0 / ranks).sum() / ranks
    q = np.empty_like(p)
    q[order] = np.minimum(1.0, np.minimum.accumulate(scaled[::-1])[::-1])
    return q
