# SPDX-License-Identifier: Apache-2.0
"""Judges random fields that stay the same from frame to frame: gains and offsets of pixels, rows or dots, and speckle.

A draw is one random number of a field, such as the gain of one pixel, one row or one dot. Each field is a
random-effects model: residual = lever * b[draw] + noise, b ~ N(0, sigma^2). For each group of frames, b is predicted
from the other groups alone (best linear unbiased prediction, Robinson 1991). So the fall of the squared error is not
overfitted.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt, maximum_filter

from activestereo.capture.capture import SIDES, Frame
from activestereo.common.grouped import grouped
from activestereo.compare.image_errors import ImageErrors
from activestereo.diagnose.evidence import Observation, edges
from activestereo.diagnose.fitter import ImageResidual
from activestereo.diagnose.goodness import Interval, interval, within_ranges
from activestereo.diagnose.numbers import Numbers
from activestereo.effects import Effect
from activestereo.effects.core.descriptor import Channel, Lever, RandomTerm, SharedBy
from activestereo.effects.core.dots import DotView

# Side of the pattern's cells that share one gain, in pattern pixels: as large as a dot.
DOT_CELL_PX = 3
# Dots of the pattern are at least so many pattern pixels apart, and no dimmer than this share of the brightest.
_DOT_PX, _DIMMEST = 5, 0.1
_SPREAD, _SEED = 0.1, 13
# Draws are independent so many steps apart: images that are resampled share one step, cells of dots do too. Two steps
# and three tell structure that alternates.
_APART = (2, 3)
# Least share of the true variance by which an estimate is divided: less would only amplify noise.
_LEAST = 0.1
_JACKKNIFE = 16
# A block of b x b pixels averages so many draws: b to this power.
_AVERAGED = {SharedBy.PIXEL: 2, SharedBy.VIEW: 2, SharedBy.ROW: 1, SharedBy.COLUMN: 1, SharedBy.DOT: 0}
# Levels of the expected value; their mean residual separates a curve that all pixels share from random draws.
_LEVELS = 24
# Pixels count if they are so many deviations of a draw from both ends of the range: clipped draws look smaller.
_CLEAR_OF_ENDS = 2.0


def pose_key(o: Observation) -> tuple[bytes, bool]:
    """Returns a key that is equal for images taken at the same pose, both moving or both at rest."""
    return o.frame.camera_to_world.tobytes(), o.frame.is_moving


def lever_image(lever: Lever, frame: Frame, expected: np.ndarray, projector: np.ndarray, black_dn: float) -> np.ndarray:
    """Returns the change in DN of each pixel, [height][width], by a random draw of 1 at parameter value 1. lever: the
    signal that the draw multiplies."""
    if lever is Lever.SIGNAL:
        return expected - black_dn
    if lever is Lever.PROJECTOR:
        return projector
    if lever is Lever.EXPOSURE:
        return np.full(expected.shape, frame.exposure_gain)
    if lever is Lever.PHOTONS:
        return np.sqrt(np.maximum(frame.gain * (expected - black_dn), 0.0))
    return np.ones(expected.shape)


def draws_growth(effect: Effect, errors: ImageErrors, black_dn: float) -> float:
    """Returns the ratio of test to train frames in the squared error, DN^2, that an effect's draws leave."""
    growth = []
    for term in effect.random_terms:
        squares: dict[str, list[float]] = {}
        for frame in errors.capture.frames:
            for side in SIDES:
                expected = errors.predictions[frame.id, side]
                projector = frame.projector_power * frame.exposure_gain * errors.layers[frame.id][side].projector
                lever = lever_image(term.lever, frame, expected, projector, black_dn)
                squares.setdefault(frame.split, []).append(float((lever**2).mean()))
        growth.append(np.mean(squares["test"]) / np.mean(squares["train"]))
    return float(max(growth))


def _draw_index(term: RandomTerm, o: Observation, known: dict[Hashable, Any]) -> np.ndarray:
    """Returns the index of each pixel's draw, [height][width]; pixels with the same index share one draw. known: a
    cache to pass again in all calls for one effect."""
    height, width = o.measured.shape
    right = o.side == "right"
    if term.shared_by is SharedBy.COLUMN:
        return np.broadcast_to(np.arange(width) + right * width, o.measured.shape)
    if term.shared_by is SharedBy.ROW:
        return np.broadcast_to(np.arange(height)[:, None] + right * height, o.measured.shape)
    if term.shared_by is SharedBy.DOT:
        key = o.side, pose_key(o)
        if key not in known:
            dots, (height, width) = DotView.of(o.view), draw_grid(SharedBy.DOT, o)
            u, v = (np.floor((x + 0.5) / DOT_CELL_PX).astype(int) for x in (dots.u, dots.v))
            inside = dots.lit & (u >= 0) & (u < width) & (v >= 0) & (v < height)
            known[key] = np.where(inside, v * width + u, height * width)
        return np.asarray(known[key])
    pixel = np.arange(o.measured.size).reshape(o.measured.shape) + right * o.measured.size
    if term.shared_by is SharedBy.PIXEL:
        return pixel
    return pixel + 2 * o.measured.size * known.setdefault(pose_key(o), len(known))


def draw_grid(shared_by: SharedBy, o: Observation) -> tuple[int, ...]:
    """Returns the shape of the grid of draws in one image (for dots: of the pattern's cells)."""
    if shared_by is SharedBy.COLUMN:
        return o.measured.shape[1:]
    if shared_by is SharedBy.ROW:
        return o.measured.shape[:1]
    if shared_by is SharedBy.DOT:
        return tuple(-(-n // DOT_CELL_PX) for n in o.view.pattern.shape)
    return o.measured.shape


def dots_seen(train: Sequence[ImageResidual], variance_of: Callable[[list[np.ndarray]], float]) -> float:
    """Returns the ratio of estimated to true variance for gains that vary independently from dot to dot.

    The estimate bins dots into cells of the pattern. It is too small, because neighbouring dots share pixels and cells.
    The ratio comes from simulated gains (method of simulated moments: McFadden 1989) with mean 1 and deviation _SPREAD.
    Each pattern pixel has the gain of the nearest dot. variance_of: estimates the variance from the train images'
    residuals.
    """
    first = train[0][0].view
    pattern = first.pattern
    peaks = (pattern == maximum_filter(pattern, _DOT_PX)) & (pattern > _DIMMEST * pattern.max())
    draws = np.zeros(pattern.shape)
    draws[peaks] = np.random.Generator(np.random.PCG64([_SEED, first.seed])).normal(1.0, _SPREAD, int(peaks.sum()))
    drawn = pattern * draws[tuple(distance_transform_edt(~peaks, return_distances=False, return_indices=True))]
    residuals = []
    for o, _, dots, _ in train:
        view = DotView.of(o.view)
        nominal = view.nominal()
        residuals.append(
            dots * np.where(nominal > 0, view.mean(drawn) / np.where(nominal > 0, nominal, 1.0) - 1.0, 0.0)
        )
    return max(variance_of(residuals) / _SPREAD**2, _LEAST)


@dataclass(frozen=True)
class FieldFit:
    """The fit of an effect's random fields, each with one random number (a draw) per pixel, row, dot or similar.

    residuals: of the train images, DN [height][width], after the draws predicted from other images are subtracted.
    sigma, error: {parameter: standard deviation of the draws; its standard error}. explained: the share of chi2 that
    the predicted draws explain. share: for a sparse field, the share of pixels that have a draw. unforeseen: expected
    squared error of the predicted draws, in noise variances per pixel.
    """

    residuals: tuple[np.ndarray, ...]
    sigma: Mapping[str, float]
    error: Mapping[str, float]
    explained: float
    share: float = 0.0
    unforeseen: float = 0.0


def has_extended_draws(effect: Effect) -> bool:
    """Returns whether neighbouring pixels share a draw of the effect. Such draws count as structure until they are
    predicted."""
    return any(term.shared_by not in (SharedBy.PIXEL, SharedBy.VIEW) for term in effect.random_terms)


def is_sparse(effect: Effect) -> bool:
    """Returns whether only a share of the pixels has a draw of the effect, such as hot pixels."""
    return any(term.sparse_share for term in effect.random_terms)


def imitates(effect: Effect, other: Effect) -> bool:
    """Returns whether draws of `effect` can explain draws of `other`, but not the reverse. Offsets of all pixels
    imitate outliers, and draws of a single view imitate draws that all views share."""
    if is_sparse(other):
        return all(term.lever is Lever.ONE for term in effect.random_terms)
    of_view, lasting = ([t.shared_by is SharedBy.VIEW for t in e.random_terms] for e in (effect, other))
    return all(of_view) and not any(lasting)


def field_parameters(effect: Effect, fit: FieldFit, binning: int = 1) -> dict[str, Interval]:
    """Returns the fitted parameters of a random effect with their intervals. binning: side of the blocks of pixels over
    which the images were averaged. The mean of n draws varies by 1 / sqrt(n); a single outlier adds 1 / n of itself."""
    factor: dict[str, float] = {}
    for term in effect.random_terms:
        averaged = float(binning) ** _AVERAGED[term.shared_by]
        if term.sparse_share:
            factor |= {term.parameter: averaged, term.sparse_share: 1.0 / averaged}
        else:
            factor[term.parameter] = averaged**0.5
    shares = {term.sparse_share for term in effect.random_terms}
    found = {}
    for p in effect.parameters:
        of_whole = factor.get(p.name, 1.0)
        value = of_whole * (fit.share if p.name in shares else fit.sigma.get(p.name, p.neutral))
        found[p.name] = interval(p, float(np.clip(value, p.low, p.high)), of_whole * fit.error.get(p.name, 0.0))
    return within_ranges(effect, found, has_floor=True)


def fields_of(
    effects: Iterable[Effect], rows: Sequence[ImageResidual], black_dn: float, numbers: Numbers, least: float = 0.0
) -> dict[str, FieldFit]:
    """Fits the random fields of effects, whose draws other frames predict. Returns {effect: the fit} where it explains
    more than a share `least` of chi2. Fields that last only while the rig stands still are skipped unless residuals are
    uncorrelated between neighbouring pixels. black_dn: the black level."""
    chosen = [effect for effect in effects if effect.channel is Channel.STATIC_FIELD]
    if not chosen:
        return {}
    is_white, curves = _is_white(rows, numbers.neighbours), [level_means(row) for row in rows]
    judged = (e for e in chosen if is_white or all(term.shared_by is not SharedBy.VIEW for term in e.random_terms))
    fits = ((e.id, fit_fields(e, rows, curves, black_dn, numbers, least)) for e in judged)
    return {name: fit for name, fit in fits if fit is not None}


def _is_white(rows: Sequence[ImageResidual], neighbours: float) -> bool:
    """Returns whether the residuals that repeats of a view share are uncorrelated between neighbouring pixels, without
    edges. That holds for speckle grains, but not for shifted, dimmed or blurred dots. neighbours: the largest
    correlation allowed."""
    by_view = grouped(
        ((pose_key(o), o.frame.exposure_gain, o.frame.projector_power, o.side), (o, r)) for o, _, _, r in rows
    )
    same, beside = 0.0, np.zeros(2)
    for group in (group for group in by_view if len(group) > 1):
        first, second = (np.where(edges(o), np.nan, r * np.sqrt(o.weight)) for o, r in group[:2])
        same += np.nanmean(first * second)
        beside += [np.nanmean(first[:, 1:] * second[:, :-1]), np.nanmean(first[1:] * second[:-1])]
    return bool(same > 0 and np.abs(beside).max() < neighbours * same)


def fit_fields(
    effect: Effect, train: Sequence[ImageResidual], curves: Sequence[np.ndarray], black_dn: float, numbers: Numbers,
    least: float = 0.0,
) -> FieldFit | None:  # fmt: skip
    """Fits an effect's random fields one after another, each to what the earlier ones leave.

    Returns None if there are fewer than two groups of frames, if no field repeats and is random, or if the predicted
    draws explain no more than the share `least` of chi2. curves: level_means() of each train image, subtracted first:
    an error that depends on brightness alone is no random field.
    """
    known, share, unforeseen, dots = dict[Hashable, Any](), 0.0, 0.0, dict[str, list[_Row]]()
    left, sigma, error = [row.residual - curve for row, curve in zip(train, curves, strict=True)], {}, {}
    for term in effect.random_terms:
        name = term.parameter
        rows = [_row_of(term, image, r, black_dn, known) for image, r in zip(train, left, strict=True)]
        if len({row.group for row in rows}) < 2:
            return None
        variance, deviation = _variance(_unclipped(rows, train, _variance(rows)[0]))
        totals = np.sum([*_group_sums(rows).values()], axis=0)
        sigma[name], error[name], hot_sigma = float(np.sqrt(max(variance, 0.0))), float(deviation), None
        if term.sparse_share:
            hot_sigma = _outlier_sigma(totals, numbers)
            share, sigma[name], error[name] = _exponential_tail(totals, hot_sigma)
            is_random = share > 0
        else:
            grid = draw_grid(term.shared_by, train[0].observation)
            is_random = variance > 0 and _is_random(totals, variance, grid, numbers)
        if not is_random:
            sigma[name] = 0.0
            continue
        if term.shared_by is SharedBy.DOT:
            dots[name] = rows
        if hot_sigma is None:
            squares = 0.0  # the draws' expected squared error, in noise variances, summed over the pixels
            for image, row in zip(train, rows, strict=True):
                rest = variance / (1.0 + variance * _leave_one_out_sums(row, rows, totals)[0])
                squares += float((image.observation.weight * row.z**2 * rest[row.index]).sum())
            unforeseen += squares / sum(row.residual.size for row in rows)
        left = [_corrected(row, rows, totals, variance, hot_sigma, numbers.outlier) for row in rows]
    if not any(sigma.values()):
        return None
    residuals = tuple(r + curve for r, curve in zip(left, curves, strict=True))
    before, after = (
        float(sum((image.observation.weight * r**2).sum() for image, r in zip(train, rest, strict=True)))
        for rest in ([row.residual for row in train], residuals)
    )
    explained = 1.0 - after / before
    if explained <= least:
        return None
    for name, rows in dots.items():

        def variance_of(residuals: Sequence[np.ndarray], rows: Sequence[_Row] = rows) -> float:
            return _variance([replace(row, residual=r) for row, r in zip(rows, residuals, strict=True)])[0]

        seen = np.sqrt(dots_seen(train, variance_of))
        sigma[name], error[name] = sigma[name] / seen, error[name] / seen
    return FieldFit(residuals, sigma, error, explained, share, unforeseen)


def level_means(row: ImageResidual) -> np.ndarray:
    """Returns each pixel's mean residual over all pixels of about the same expected value, [height][width]."""
    between = np.quantile(row.expected, np.arange(1, _LEVELS) / _LEVELS)
    level = np.searchsorted(between, row.expected.ravel())
    total = np.bincount(level, row.residual.ravel(), minlength=_LEVELS)
    return (total / np.maximum(np.bincount(level, minlength=_LEVELS), 1))[level].reshape(row.residual.shape)


def _outlier_sigma(totals: np.ndarray, numbers: Numbers) -> float:
    """Returns the threshold of an outlier in noise deviations. It is higher if most draws exceed the noise."""
    a, b = totals[:, totals[0] > 0]
    return numbers.outlier * max(1.0, float(np.median(np.abs(b) / np.sqrt(a))) / 0.6745)


def _exponential_tail(totals: np.ndarray, hot_sigma: float) -> tuple[float, float, float]:
    """Returns (share of pixels with a draw, mean draw, its standard error) for exponential draws. Only draws beyond
    hot_sigma noise deviations are seen. Their mean excess over the threshold equals the mean of all draws."""
    strong = _exceeds_noise(totals, hot_sigma)
    if not strong.any():
        return 0.0, 0.0, 0.0
    a, b = totals[:, strong]
    least = hot_sigma / np.sqrt(a)
    mean = float((b / a - least).mean())
    return float(np.exp(least / mean).sum() / (totals[0] > 0).sum()), mean, mean / float(np.sqrt(strong.sum()))


def _exceeds_noise(totals: np.ndarray, hot_sigma: float) -> np.ndarray:
    """Returns whether each draw of a sparse field exceeds hot_sigma noise deviations, bool [draw]."""
    a, b = totals
    return b > hot_sigma * np.sqrt(np.maximum(a, 1e-30))


@dataclass(frozen=True)
class _Row:
    """One image's sums for the prediction of its draws: a = sum of w z^2 and b = sum of w z r over each draw's pixels.
    weight w, lever z (DN per draw), residual r: [height][width]. index: each pixel's draw. group: the group of frames;
    draws in a group are predicted only from other groups."""

    group: Hashable
    index: np.ndarray
    z: np.ndarray
    residual: np.ndarray
    weight: np.ndarray

    def sums(self, size: int) -> np.ndarray:
        flat, lever = self.index.ravel(), self.weight * self.z
        parts = lever * self.z, lever * self.residual
        return np.array([np.bincount(flat, part.ravel(), minlength=size) for part in parts])


def _row_of(
    term: RandomTerm, image: ImageResidual, residual: np.ndarray, black_dn: float, known: dict[Hashable, Any]
) -> _Row:
    """Returns the _Row of an image. Usually all frames at one pose form one group, because they share other errors too,
    such as misplaced edges. Draws that last only while the rig stands still exist in one view alone. For them each
    frame is a group, and pixels at edges get weight 0."""
    o, is_still = image.observation, term.shared_by is SharedBy.VIEW
    group = o.frame.id if is_still else o.frame.camera_to_world.tobytes()
    weight = np.where(edges(o), 0.0, o.weight) if is_still else o.weight
    lever = lever_image(term.lever, o.frame, image.expected, image.projector, black_dn)
    return _Row(group, _draw_index(term, o, known), lever, residual, weight)


def _is_random(totals: np.ndarray, variance: float, shape: tuple[int, ...], numbers: Numbers) -> bool:
    """Returns whether draws that lie _APART steps apart on their grid are independent. Their covariance must be a small
    share of the variance, of either sign."""
    count = len(totals[0]) // int(np.prod(shape)) * int(np.prod(shape))
    a, b = (total[:count].reshape(-1, *shape) for total in totals)
    for axis, apart in product(range(1, a.ndim), _APART):
        near, far = np.arange(a.shape[axis] - apart), np.arange(apart, a.shape[axis])
        both = (a.take(near, axis) * a.take(far, axis)).sum()
        if both > 0 and abs((b.take(near, axis) * b.take(far, axis)).sum()) > numbers.neighbours * variance * both:
            return False
    return True


def _unclipped(rows: Sequence[_Row], train: Sequence[ImageResidual], variance: float) -> list[_Row]:
    """Returns the rows with weight 0 at pixels that draws of this variance may clip at 0 or at the largest DN."""
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
    """Returns (variance of the draws, standard error of their standard deviation).

    Only products of different groups count. They are unbiased under any noise that groups do not share. The error comes
    from a jackknife over interleaved subsets of the draws.
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
    row: _Row, rows: Sequence[_Row], totals: np.ndarray, variance: float, hot_sigma: float | None, outlier: float
) -> np.ndarray:
    """Returns an image's residual in DN minus the draws that other groups of frames predict. hot_sigma: in a sparse
    field, only draws beyond this many noise deviations are subtracted. None: all draws are subtracted except those
    beyond `outlier` deviations of this field, which belong to another field."""
    others = _leave_one_out_sums(row, rows, totals)
    a, b = others
    if hot_sigma is None:
        value = b / (a + 1.0 / variance)
        value[np.abs(value) > outlier * np.sqrt(variance)] = 0.0
    else:
        value = np.where(_exceeds_noise(others, hot_sigma), b / np.maximum(a, 1e-30), 0.0)
    return row.residual - row.z * value[row.index]


def _leave_one_out_sums(row: _Row, rows: Sequence[_Row], totals: np.ndarray) -> np.ndarray:
    """Returns the sums (a, b) of all groups of frames except the image's own, [2][draw]. totals: the sums of all
    groups."""
    return totals - np.sum([other.sums(totals.shape[1]) for other in rows if other.group == row.group], axis=0)
