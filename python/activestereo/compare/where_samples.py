# SPDX-License-Identifier: Apache-2.0
"""The residuals of a comparison as one list of pixels with their covariates, bins and blocks.

Three channels: infrared (DN), disparity (px, where device and model both measured), validity (1 = the device alone
measured, -1 = the model alone). Train frames only: test frames stay unseen by whoever reads where the model fails.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from activestereo.compare.covariates import COVARIATES

BLOCK_PX = 16
GROUPS = 512
BINS = 20
_MOST_PIXELS = 1_200_000
# A mismatch is an error of any size; beyond this many pixels of disparity it counts no more.
LARGEST_DISPARITY_ERROR_PX = 2.0


@dataclass(frozen=True)
class ResidualImage:
    """One image's share: residual, floor (what a perfect model's squared residual would be, expected) and mask,
    [height][width]; maps: covariates; pose: what repeats share, so that their blocks are one."""

    residual: np.ndarray
    floor: np.ndarray
    mask: np.ndarray
    maps: dict[str, np.ndarray]
    pose: bytes


@dataclass(frozen=True)
class Bins:
    """Codes 1..count of a covariate, 0 = not defined. edges: [count + 1] of intervals (low, high], or values: one per
    code."""

    code: np.ndarray
    edges: np.ndarray | None
    values: np.ndarray | None

    @property
    def count(self) -> int:
        if self.edges is not None:
            return len(self.edges) - 1
        return 0 if self.values is None else len(self.values)


@dataclass(frozen=True)
class Samples:
    """Pixels [n]: residual, excess (squared residual above the floor), floor, group of blocks; bins: {covariate: Bins}.
    """

    residual: np.ndarray
    excess: np.ndarray
    floor: np.ndarray
    group: np.ndarray
    bins: dict[str, Bins]

    @property
    def total_excess(self) -> float:
        return float(self.excess.sum())

    def group_sums(self, values: np.ndarray, code: np.ndarray | None = None, count: int = 0) -> np.ndarray:
        """Sums by group, [groups][1], or by group and code 1..count, [groups][count]."""
        if code is None:
            return np.bincount(self.group, values, GROUPS)[:, None]
        sums = np.bincount(self.group * (count + 1) + code, values, GROUPS * (count + 1))
        return sums.reshape(GROUPS, count + 1)[:, 1:]


def gather_samples(images: Sequence[ResidualImage], seed: int = 0) -> Samples | None:
    """Samples of ResidualImages, a random subset of pixels where there are very many; None where there is no pixel at
    all."""
    rng = np.random.Generator(np.random.Philox(seed))
    total = sum(int(image.mask.sum()) for image in images)
    if total == 0:
        return None
    share = min(1.0, _MOST_PIXELS / total)
    keep = [i.mask if share == 1.0 else i.mask & (rng.random(i.mask.shape) < share) for i in images]

    def pick(name: str) -> np.ndarray:
        return np.concatenate([getattr(i, name)[k] for i, k in zip(images, keep, strict=True)]).astype(np.float64)

    residual, floor = pick("residual"), pick("floor")
    bins = {}
    for covariate in COVARIATES:
        values = np.concatenate([i.maps[covariate.name][k] for i, k in zip(images, keep, strict=True)])
        found = _bin_values(values, covariate.is_category)
        if found.count > 1:
            bins[covariate.name] = found
    return Samples(residual, residual**2 - floor, floor, _groups(images, keep, rng), bins)


def _groups(images: Sequence[Any], keep: Any, rng: np.random.Generator) -> np.ndarray:
    """Blocks of 16 px of one pose and camera, dealt at random to the groups that are resampled."""
    first, firsts, parts = 0, {}, []
    for image, kept in zip(images, keep, strict=True):
        rows, columns = (np.arange(n) // BLOCK_PX for n in kept.shape)
        across = columns[-1] + 1
        if image.pose not in firsts:
            firsts[image.pose] = first
            first += (rows[-1] + 1) * across
        parts.append((firsts[image.pose] + rows[:, None] * across + columns)[kept])
    return (rng.permutation(first) % GROUPS)[np.concatenate(parts)]


def _bin_values(values: np.ndarray, is_category: bool) -> Bins:
    """Own bins for few distinct values, else 20 of equal pixel counts with edges that are round numbers."""
    finite = np.isfinite(values)
    some = values[finite]
    distinct = np.unique(some[:: max(1, some.size // 100_000)]) if not is_category else np.unique(some)
    if is_category or len(distinct) <= BINS and np.isin(some, distinct).all():
        code = np.searchsorted(distinct, values) + 1
        return Bins(np.where(finite, np.minimum(code, len(distinct)), 0), None, distinct.astype(np.float64))
    edges = np.quantile(some, np.linspace(0.0, 1.0, BINS + 1))
    step = _round_step((edges[-2] - edges[1]) / 50.0)
    inner = np.unique(np.round(edges[1:-1] / step) * step)
    inner = inner[(inner > edges[0]) & (inner < edges[-1])]
    filled = np.bincount(np.searchsorted(inner, some, side="left"), minlength=len(inner) + 1) > 0
    inner = inner[filled[:-1]]  # an empty bin is one with the next
    code = np.searchsorted(inner, values, side="left") + 1
    return Bins(np.where(finite, code, 0), np.concatenate([edges[:1], inner, edges[-1:]]), None)


def _round_step(step: float) -> float:
    """The largest of 1, 2, 5 x 10^n that is not above `step`."""
    power = 10.0 ** np.floor(np.log10(step)) if step > 0 else 1.0
    return float(max(m * power for m in (1, 2, 5) if m * power <= max(step, power)))
