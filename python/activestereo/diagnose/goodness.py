# SPDX-License-Identifier: Apache-2.0
"""Measures how good a fit is: effective pixels, penalties for free parameters, intervals, remaining structure.

The penalty is Laplace's estimate of the evidence relative to the best likelihood (MacKay 2003, chapter 28), accurate to
a few nats. Of two effects that explain the data equally well, it prefers the one that needs less fine tuning and less
unusual parameters.

Structure measures goodness of fit without an alternative hypothesis: how much of a residual a smooth effect could still
explain. Within a tile every smooth effect acts as an offset, a gain, a displacement or a blur. These are fitted to each
half of the tile's pixels separately. The part on which both halves agree is structure, the rest is noise. Independent
draws (photons, read noise, grains, the renderer's samples) do not agree, in expectation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.ndimage import laplace
from scipy.special import chdtri

from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.diagnose.evidence import TILE_PX
from activestereo.diagnose.fitter import Fitter, ImageResidual, Solution
from activestereo.effects import Effect, Parameter

# Normal quantile of a two-sided 90 % interval.
Z90 = 1.645
# Formulas and scene measurement are approximate to this share of a found value. Held-out cases with formulas of their
# own err by 8 % in the median, practice captures by 0.2-5 %. With this share, intervals hold the truth in 20 of 22
# cases of generation 1.
_INADEQUACY = 0.10
Limits = tuple[float, float, float]
# Side of the chessboard's squares that make up the halves: neighbours share noise where images were resampled.
_SQUARE_PX = 4
# Precision of the coefficients' prior, as a part of the mean information of half a tile: coefficients that it cannot
# tell apart stay small.
_RIDGE = 0.05


def design_effect(tile_chi2: np.ndarray, tile_pixels: np.ndarray) -> float:
    """Returns the variance of the tiles' chi2 over its variance for independent normal pixels; at least 1. The number
    of pixels divided by it is the effective number of independent pixels. tile_chi2, tile_pixels: [tile]."""
    full = tile_pixels > 0.5 * tile_pixels.max()
    chi2, pixels = tile_chi2[full], tile_pixels[full]
    scale = max(chi2.sum() / pixels.sum(), 1e-12)
    return float(max(1.0, (chi2 / pixels).var() * pixels.mean() / (2.0 * scale**2)))


def chance_chi2(fitter: Fitter, fit: Solution, left: float, parameters: int, probability: float) -> float:
    """Returns the fall of chi2 that fitted parameters exceed by chance with this probability, for pixels that vary
    together. left: chi2 of the fit."""
    design = design_effect(fit.sums.tile_chi2, fitter.tile_pixels())
    return design * left / fitter.pixels_used() * float(chdtri(parameters, probability))


def occam_nats(fitter: Fitter, solution: Solution, effect: Effect, design: float) -> float:
    """Returns the penalty in nats for a fitted effect's free parameters, a number to add to its gain. It is the log of
    the prior density at the fitted values times the posterior volume.

    Any of the parameters may instead stay neutral, which lowers the likelihood. All choices of free parameters are
    equally probable, and the best one counts. design: the residuals' design effect.
    """
    first = len(solution.theta) - len(effect.parameters)
    free = first + np.flatnonzero(~solution.space.given[first:])
    if not free.size:
        return 0.0
    parameters = [solution.space.pairs[i][1] for i in free]
    typical = np.array([p.typical for p in parameters])
    away = (solution.theta[free] - solution.space.neutral[free]) / typical
    density = np.array([_log_density(p, x) for p, x in zip(parameters, away, strict=True)])
    # What the data tell of these parameters with all others and the nuisances fitted too (Schur's complement).
    gram = solution.sums.gram + np.diag(fitter.prior(len(solution.theta), solution.space))
    rest = np.setdiff1d(np.arange(len(gram)), free)
    cross = gram[np.ix_(free, rest)]
    told = gram[np.ix_(free, free)] - cross @ inverse_normal_matrix(gram[np.ix_(rest, rest)]) @ cross.T
    information = told * np.outer(typical, typical) / design
    sizes = range(1, len(free) + 1)
    kept = (list(chosen) for size in sizes for chosen in combinations(range(len(free)), size))
    peaks = np.array([_log_density(p, 0.0) for p in parameters])
    return max(_cost(k, away, density, information, peaks) for k in kept) - float(np.log(2 ** len(free) - 1))


def _cost(kept: list[int], away: np.ndarray, density: np.ndarray, information: np.ndarray, peaks: np.ndarray) -> float:
    """Returns the penalty in nats if only the parameters `kept` are free.

    away: distances from neutral, in typical values. information: the Fisher information in these units. density, peaks:
    log prior densities at the fitted values and at the neutral values.
    """
    used, unused = np.array(kept, dtype=np.int64), np.setdiff1d(np.arange(len(away)), kept)
    across, inner = information[np.ix_(unused, used)], information[np.ix_(used, used)]
    alone = information[np.ix_(unused, unused)] - across @ np.linalg.pinv(inner, hermitian=True) @ across.T
    loss = away[unused] @ alone @ away[unused]
    # Without information a parameter keeps the prior's volume, one over its peak, so that at neutral it costs nothing.
    told = inner + 2.0 * np.pi * np.diag(np.exp(2.0 * peaks[used]))
    volume = len(used) * np.log(2.0 * np.pi) - np.linalg.slogdet(told)[1]
    return float(density[kept].sum() + 0.5 * volume - 0.5 * max(loss, 0.0))


def _log_density(parameter: Parameter, away: float) -> float:
    """Returns a parameter's log prior density per typical value. away: its distance from neutral, in typical values.
    Only the order of magnitude is known, so the prior is Cauchy's (Gelman et al. 2008, A weakly informative default
    prior distribution)."""
    one_sided = parameter.low >= parameter.neutral or parameter.high <= parameter.neutral
    return np.log((2.0 if one_sided else 1.0) / np.pi) - np.log1p(away**2)


@dataclass(frozen=True)
class Interval:
    """A fitted parameter: its value and the ends of its 90 % interval, in `unit`. floor: the half width due to model
    error, which no amount of data reduces."""

    value: float
    low: float
    high: float
    unit: str
    floor: float = 0.0


def interval(parameter: Parameter, value: float, deviation: float) -> Limits:
    """Returns (value, low, high) of a 90 % interval. It combines the standard error `deviation` with floor()."""
    half = 0.0 if parameter.choice else float(np.hypot(Z90 * deviation, floor(parameter, value)))
    return value, value - half, value + half


def floor(parameter: Parameter, value: float) -> float:
    """Returns the half width of a 90 % interval due to model error alone. It is a share of the value. The value is an
    amplitude with neutral value 0, or a shape (a focus, a frequency, a doubling temperature)."""
    return 0.0 if parameter.choice else Z90 * _INADEQUACY * abs(float(value))


def intervals(fitter: Fitter, solution: Solution, effect: Effect) -> dict[str, Interval]:
    """Returns the 90 % intervals of an effect's parameters in a Solution."""
    deviation = np.sqrt(np.maximum(np.diag(fitter.covariance(solution)), 0.0))[: len(solution.theta)]
    found = zip(solution.space.pairs, solution.theta, deviation, strict=True)
    return within_ranges(effect, {p.name: interval(p, v, d) for (e, p), v, d in found if e.id == effect.id}, True)


def within_ranges(effect: Effect, found: Mapping[str, Limits], has_floor: bool = False) -> dict[str, Interval]:
    """Returns intervals clipped to the parameters' ranges. A parameter missing in `found` gets its neutral value and
    whole range. has_floor: whether the intervals come from interval()."""
    out = {}
    for p in effect.parameters:
        value, low, high = found.get(p.name, (p.neutral, p.low, p.high))
        low, high = (min(max(p.low, low), p.high), max(min(p.high, high), p.low))  # a NaN end becomes the range's end
        least = floor(p, value) if has_floor and p.name in found else 0.0
        out[p.name] = Interval(float(np.clip(value, p.low, p.high)), float(low), float(high), p.unit, least)
    return out


def excess_of(rows: Sequence[ImageResidual]) -> float:
    """Returns the mean squared residual beyond the noise, in noise variances."""
    square = sum(float((row.observation.weight * row.residual**2).sum()) for row in rows)
    return square / sum(row.observation.pixels for row in rows) - 1.0


def mean_square(rows: Sequence[ImageResidual], weights: Sequence[np.ndarray]) -> float:
    """Returns the mean squared residual of images under given weights, 1/DN^2, in noise variances."""
    squares = (w * row.residual**2 for w, row in zip(weights, rows, strict=True))
    shown = [s.ravel()[row.observation.picked()] for s, row in zip(squares, rows, strict=True)]
    return float(np.mean(np.concatenate(shown)))


def local_structure(rows: Sequence[ImageResidual]) -> float:
    """Returns the mean square per pixel, in noise variances, of the residual's part on which both tile halves agree.

    It is unbiased up to the ridge, which holds it down: for pure noise it is near 0, of either sign.
    """
    pixels = [row.observation.pixels for row in rows]
    return sum(image_structure(row) * n for row, n in zip(rows, pixels, strict=True)) / sum(pixels)


def image_structure(row: ImageResidual) -> float:
    """Returns local_structure() for one image."""
    o, image, _, residual = row
    root = np.sqrt(o.weight)
    slope_v, slope_u = np.gradient(image)
    shapes = [_cut(root * c) for c in (np.ones(image.shape), image, slope_u, slope_v, laplace(image))]
    x, target = np.stack(shapes, axis=-1), _cut(root * residual)
    place = np.arange(TILE_PX) // _SQUARE_PX
    first = (np.add.outer(place, place) % 2 == 0).ravel()
    halves = [(x[:, half], target[:, half]) for half in (first, ~first)]
    grams = [columns.transpose(0, 2, 1) @ columns for columns, _ in halves]
    norm = np.sqrt(np.maximum(0.5 * np.einsum("tii->ti", grams[0] + grams[1]), 1e-30))
    a, b = (_ridge_fit(gram, columns, y, norm) for gram, (columns, y) in zip(grams, halves, strict=True))
    agreed = np.einsum("ti,tij,tj->t", a, grams[0] + grams[1], b)
    return float(agreed.sum() / target.size * row.residual.size / o.pixels)


def _cut(values: np.ndarray) -> np.ndarray:
    """Cuts an image into tiles, [tile][pixel of the tile]; tiles that the image's border cuts are left out."""
    rows, columns = (n // TILE_PX for n in values.shape)
    cut = values[: rows * TILE_PX, : columns * TILE_PX].reshape(rows, TILE_PX, columns, TILE_PX)
    return cut.transpose(0, 2, 1, 3).reshape(rows * columns, TILE_PX**2)


def _ridge_fit(gram: np.ndarray, x: np.ndarray, target: np.ndarray, norm: np.ndarray) -> np.ndarray:
    """Fits a ridge regression in each tile; returns coefficients [tile][column].

    norm: of the columns, [tile][column], the same for both halves. The ridge is a part of a half's mean information on
    a column. A half that hardly shows a column (an edge that lies in the other half) therefore gets a small
    coefficient.
    """
    scaled = gram / (norm[:, :, None] * norm[:, None, :]) + _RIDGE * np.eye(x.shape[2])
    moment = np.einsum("tpi,tp->ti", x, target) / norm
    return np.linalg.solve(scaled, moment[..., None])[..., 0] / norm
