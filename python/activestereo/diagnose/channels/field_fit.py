# SPDX-License-Identifier: Apache-2.0
"""Fits static random fields (gains and offsets of pixels, dots, speckle), which one frame predicts for another.

Each is a random-effects model: residual = lever * b[draw] + noise, b ~ N(0, sigma^2). b is predicted for each group of
frames from the other groups alone (best linear unbiased prediction, Robinson 1991). The fall of the squared error is
therefore not overfitted.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from activestereo.diagnose.channels.draws import DrawIndex, dots_seen, draw_grid, frames_that_share, lever_image
from activestereo.diagnose.evidence.model_discrepancy import edges
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.refine import ImageResidual
from activestereo.diagnose.score.intervals import Interval, interval, within_ranges
from activestereo.effects import Effect
from activestereo.effects.core.judging import RandomTerm, SharedBy

_JACKKNIFE = 16
# Levels of the expected value; their mean residual separates a curve that all pixels share from random draws.
_LEVELS = 24
# Pixels count if they are so many deviations of a draw from both ends of the range: clipped draws look smaller.
_CLEAR_OF_ENDS = 2.0


@dataclass(frozen=True)
class FieldFit:
    """The fit of an effect's random fields (one random number, a draw, for each pixel, row, dot or so).

    residuals: of the train images, DN [height][width], after the draws predicted from other images are subtracted.
    sigma, error: {parameter: standard deviation of the draws, its standard error}. share: part of the places that have
    a draw in a sparse field. unforeseen: expected squared error of the predicted draws, noise variances per pixel.
    """

    residuals: tuple[np.ndarray, ...]
    sigma: Mapping[str, float]
    error: Mapping[str, float]
    share: float = 0.0
    unforeseen: float = 0.0


def has_extended_draws(effect: Effect) -> bool:
    """Returns whether neighbouring pixels share a draw of the effect: such draws are structure until they are
    predicted."""
    return any(term.shared_by not in (SharedBy.PIXEL, SharedBy.VIEW) for term in effect.random_terms)


def has_sparse_draws(effect: Effect) -> bool:
    """Returns whether only some places have a draw of the effect."""
    return any(term.sparse_share for term in effect.random_terms)


def field_parameters(effect: Effect, fit: FieldFit) -> dict[str, Interval]:
    """Returns the fitted parameters of a random effect with their intervals."""
    shares = {term.sparse_share for term in effect.random_terms}
    found = {}
    for p in effect.parameters:
        value = fit.share if p.name in shares else fit.sigma.get(p.name, p.neutral)
        found[p.name] = interval(p, float(np.clip(value, p.low, p.high)), fit.error.get(p.name, 0.0))
    return within_ranges(effect, found, has_floor=True)


def fit_fields(
    effect: Effect, train: Sequence[ImageResidual], curves: Sequence[np.ndarray], black_dn: float, numbers: Numbers
) -> FieldFit | None:
    """Fits an effect's random fields one after another, each to what the earlier ones leave.

    Returns None if there are fewer than two groups of frames, or the residual neither repeats nor is random. curves:
    level_means() of each train image, subtracted first: an error that depends on brightness alone is no random field.
    """
    train = _with_residuals(train, [row.residual - curve for row, curve in zip(train, curves, strict=True)])
    index, share, unforeseen, found = DrawIndex(), 0.0, 0.0, False
    sigma, error = {}, {}
    for term in effect.random_terms:
        rows = [_row_of(term, row, black_dn, index) for row in train]
        if len({row.group for row in rows}) < 2:
            return None
        first = _variance(rows)[0]
        variance, deviation = _variance(_unclipped(rows, train, first))
        sigma[term.parameter], error[term.parameter] = float(np.sqrt(max(variance, 0.0))), float(deviation)
        totals = np.sum([*_group_sums(rows).values()], axis=0)
        grid = draw_grid(term.shared_by, train[0].observation)
        sparse = numbers.outlier * _spread(totals) if term.sparse_share else None
        if variance <= 0 or not (term.sparse_share or _is_random(totals, variance, *grid, numbers.neighbours)):
            sigma[term.parameter] = 0.0
            continue
        if term.shared_by is SharedBy.DOT:
            seen = np.sqrt(dots_seen(train, partial(_variance_of, rows)))
            sigma[term.parameter], error[term.parameter] = sigma[term.parameter] / seen, error[term.parameter] / seen
        found = True
        if sparse is not None:
            share, mean = _sparse(totals, sparse)
            sigma[term.parameter] = sigma[term.parameter] if mean is None else mean
        else:
            pairs = zip(train, rows, strict=True)
            squares = 0.0  # the draws' expected squared error, in noise variances, summed over the pixels
            for image, row in pairs:
                left = variance / (1.0 + variance * _leave_one_out_sums(row, rows, totals)[0])
                squares += float((image.observation.weight * row.z**2 * left[row.index]).sum())
            unforeseen += squares / sum(row.residual.size for row in rows)
        train = _with_residuals(train, [_corrected(row, rows, totals, variance, sparse) for row in rows])
    residuals = tuple(row.residual + curve for row, curve in zip(train, curves, strict=True))
    return FieldFit(residuals, sigma, error, share, unforeseen) if found else None


def level_means(row: ImageResidual) -> np.ndarray:
    """Returns each pixel's mean residual over all pixels of about the same expected value, [height][width]."""
    between = np.quantile(row.expected, np.arange(1, _LEVELS) / _LEVELS)
    level = np.searchsorted(between, row.expected.ravel())
    total = np.bincount(level, row.residual.ravel(), minlength=_LEVELS)
    return (total / np.maximum(np.bincount(level, minlength=_LEVELS), 1))[level].reshape(row.residual.shape)


def _with_residuals(rows: Sequence[ImageResidual], residuals: Sequence[np.ndarray]) -> list[ImageResidual]:
    return [row._replace(residual=r) for row, r in zip(rows, residuals, strict=True)]


def _sparse(totals: np.ndarray, hot_sigma: float) -> tuple[float, float | None]:
    """Returns (share of the places that have a draw, the mean of these draws or None) of a sparse field."""
    a, b = totals
    strong = _exceeds_noise(totals, hot_sigma)
    share = float(strong.sum() / max((a > 0).sum(), 1))
    return share, float((b[strong] / a[strong]).mean()) if strong.any() else None


def _spread(totals: np.ndarray) -> float:
    """Returns the spread of most draws in noise deviations, at least 1: draws that all places have are no outliers."""
    a, b = totals[:, totals[0] > 0]
    return max(1.0, float(np.median(np.abs(b) / np.sqrt(a))) / 0.6745)


def _exceeds_noise(totals: np.ndarray, hot_sigma: float) -> np.ndarray:
    """Returns where the draws of a sparse field exceed hot_sigma noise deviations, bool [draw]."""
    a, b = totals
    return b > hot_sigma * np.sqrt(np.maximum(a, 1e-30))


@dataclass(frozen=True)
class _Row:
    """Holds one image's sums for predicting its draws b: a = w z^2 and b = w z r over each draw's pixels, with weight
    w, lever z (DN per draw) and residual r. index: each pixel's draw. group: of frames, as in frames_that_share()."""

    group: Hashable
    index: np.ndarray
    z: np.ndarray
    residual: np.ndarray
    weight: np.ndarray

    def sums(self, size: int) -> np.ndarray:
        flat, lever = self.index.ravel(), self.weight * self.z
        parts = lever * self.z, lever * self.residual
        return np.array([np.bincount(flat, part.ravel(), minlength=size) for part in parts])


def _row_of(term: RandomTerm, row: ImageResidual, black_dn: float, index: DrawIndex) -> _Row:
    """Makes the _Row of an image. For draws that last only while the rig stands still, pixels at edges get weight 0:
    misplaced edges last as long."""
    o = row.observation
    weight = np.where(edges(o), 0.0, o.weight) if term.shared_by is SharedBy.VIEW else o.weight
    lever = lever_image(term.lever, row, black_dn)
    return _Row(frames_that_share(term, o), index(term, o), lever, row.residual, weight)


def _variance_of(rows: Sequence[_Row], residuals: Sequence[np.ndarray]) -> float:
    return _variance([replace(row, residual=r) for row, r in zip(rows, residuals, strict=True)])[0]


def _is_random(
    totals: np.ndarray,
    variance: float,
    shape: tuple[int, ...],
    steps: int,
    largest_correlation: float,
) -> bool:
    """Returns whether draws `steps` apart on their grid are independent: their covariance is a small part of the
    variance."""
    count = len(totals[0]) // int(np.prod(shape)) * int(np.prod(shape))
    a, b = (total[:count].reshape(-1, *shape) for total in totals)
    for axis in range(1, a.ndim):
        near, far = np.arange(a.shape[axis] - steps), np.arange(steps, a.shape[axis])
        both = (a.take(near, axis) * a.take(far, axis)).sum()
        if both > 0 and (b.take(near, axis) * b.take(far, axis)).sum() > largest_correlation * variance * both:
            return False
    return True


def _unclipped(rows: Sequence[_Row], train: Sequence[ImageResidual], variance: float) -> list[_Row]:
    """Returns the rows with weight 0 for pixels that a draw of this variance may bring to an end of the range."""
    out = []
    for row, (o, image, *_) in zip(rows, train, strict=True):
        reach = _CLEAR_OF_ENDS * np.sqrt(max(variance, 0.0)) * np.abs(row.z)
        out.append(replace(row, weight=np.where((image > reach) & (image < o.view.max_dn - reach), row.weight, 0.0)))
    return out


def _group_sums(rows: Sequence[_Row]) -> dict[Hashable, np.ndarray]:
    size = max(int(row.index.max()) for row in rows) + 1
    groups: dict[Hashable, np.ndarray] = {}
    for row in rows:
        groups[row.group] = row.sums(size) + groups.get(row.group, 0.0)
    return groups


def _variance(rows: Sequence[_Row]) -> tuple[float, float]:
    """Returns (variance of the draws, standard error of its square root).

    Only products of different groups count, which are unbiased under any noise that groups do not share. The error
    comes from a jackknife over interleaved subsets of the draws.
    """
    groups = _group_sums(rows).values()
    a, b = (np.array([sums[i] for sums in groups]) for i in range(2))
    top = b.sum(axis=0) ** 2 - (b**2).sum(axis=0)
    bottom = a.sum(axis=0) ** 2 - (a**2).sum(axis=0)
    if bottom.sum() <= 0:
        return 0.0, 0.0
    variance = top.sum() / bottom.sum()
    part = np.arange(len(top)) % _JACKKNIFE
    tops, bottoms = np.bincount(part, top, minlength=_JACKKNIFE), np.bincount(part, bottom, minlength=_JACKKNIFE)
    without = (top.sum() - tops) / np.maximum(bottom.sum() - bottoms, 1e-300)
    spread = np.sqrt((_JACKKNIFE - 1) / _JACKKNIFE * ((without - without.mean()) ** 2).sum())
    return float(variance), float(spread / (2.0 * np.sqrt(max(variance, spread, 1e-30))))


def _corrected(
    row: _Row, rows: Sequence[_Row], totals: np.ndarray, variance: float, hot_sigma: float | None
) -> np.ndarray:
    """Returns an image's residual minus the draws that other groups of frames predict, DN. hot_sigma: in a sparse
    field, only draws beyond this many noise deviations are subtracted; None: all."""
    others = _leave_one_out_sums(row, rows, totals)
    a, b = others
    if hot_sigma is None:
        value = b / (a + 1.0 / variance)
    else:
        value = np.where(_exceeds_noise(others, hot_sigma), b / np.maximum(a, 1e-30), 0.0)
    return row.residual - row.z * value[row.index]


def _leave_one_out_sums(row: _Row, rows: Sequence[_Row], totals: np.ndarray) -> np.ndarray:
    """Returns the sums (a, b) of all groups of frames except the image's own, [2][draw]. totals: the sums of all
    groups."""
    return totals - np.sum([other.sums(totals.shape[1]) for other in rows if other.group == row.group], axis=0)
