# SPDX-License-Identifier: Apache-2.0
"""Judges effects of temporal noise: row noise, coarse digital steps, and photon transfer.

The level of independent pixel noise is a nuisance. Its terms are reported with their values. They count as missing only
if the given model states its noise, that is, if it already has a term of that kind.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from activestereo.capture.capture import unbinned
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.compare.noise import Comb, by_repeats, comb_of, fit_terms, repeat_statistics, transfer_rows
from activestereo.diagnose.evidence import Evidence, Observation
from activestereo.diagnose.goodness import Z90, Interval, Limits, within_ranges
from activestereo.diagnose.numbers import Numbers
from activestereo.effects import Effect, Model
from activestereo.effects.core.descriptor import Channel, CodeSteps, Lever, RandomTerm, SharedBy

# Half of the 90 % quantile of chi-square with one degree of freedom.
_LIKELIHOOD_DROP = 1.353
# Deviations of a row's offset to try, in DN.
_ROW_SIGMAS_DN = np.geomspace(1e-3, 20.0, 400)
# How the variance of independent pixels grows: EMVA 1288's photon transfer, and a quadratic term for speckle.
_TRANSFER = {
    Lever.ONE: lambda gain, signal, square: np.ones_like(signal),
    Lever.PHOTONS: lambda gain, signal, square: gain * signal,
    Lever.SIGNAL: lambda gain, signal, square: square,
}
_NO_REPEATS = "the capture has no repeated frames of a static view"


@dataclass(frozen=True)
class NoiseTerm:
    """A fitted effect of temporal noise. nats: gain of log-likelihood. variance: explained per pixel, DN^2. values:
    {parameter: (value, low, high)}. share: part of the noise floor that the effect explains."""

    effect: Effect
    nats: float
    variance: float
    values: dict[str, Limits]
    share: float = 0.0

    def parameters(self) -> dict[str, Interval]:
        """Returns the effect's parameters with their intervals."""
        return within_ranges(self.effect, self.values)


def noise_terms(
    evidence: Evidence, given: Model, effects: Sequence[Effect], numbers: Numbers
) -> tuple[dict[str, NoiseTerm], dict[str, str]]:
    """Fits every effect of temporal noise; returns ({effect: its term}, {effect: why it was not judged}). Noise is
    judged on repeated frames, coarse steps on the histogram of digital numbers. given: the model, which may state its
    noise."""
    floor, terms, unjudged = evidence.floor_variance(evidence.train) * evidence.capture.binning**2, {}, {}
    for effect in effects:
        steps = next((j for j in effect.judged if isinstance(j, CodeSteps)), None)
        fit = _comb(evidence, effect, steps.parameter) if steps else _of_repeats(effect, evidence, given, numbers)
        if isinstance(fit, str):
            unjudged[effect.id] = fit
        else:
            terms[effect.id] = replace(fit, share=fit.variance / max(floor, fit.variance))
    return terms, unjudged


def _of_repeats(effect: Effect, evidence: Evidence, given: Model, numbers: Numbers) -> NoiseTerm | str:
    """Returns the fit of an effect to repeated frames, or the reason why it was not judged."""
    term, *more = effect.random_terms
    if more:
        return "the noise model is judged one term at a time, and its descriptor names several"
    if not evidence.capture.repeats("train"):
        return _NO_REPEATS
    if term.shared_by is SharedBy.ROW:
        return _rows(evidence.train, effect, term.parameter, numbers.neighbours, evidence.capture.binning)
    if term.shared_by is not SharedBy.PIXEL or term.lever not in _TRANSFER:
        return f"the noise model has no term of draws per {term.shared_by.value} with the lever {term.lever.value}"
    return _transfer(effect, term, evidence, given)


def _comb(evidence: Evidence, effect: Effect, parameter: str) -> NoiseTerm:
    """Fits the step between the digital numbers that occur, as of a converter with coarse steps. parameter: the name of
    the step's parameter."""
    comb = comb_in(evidence)
    if comb is None:
        return NoiseTerm(effect, 0.0, 0.0, {parameter: (0.0, 0.0, 1.0)})
    step = comb.step_dn
    limits = {parameter: (step, *comb.limits_dn)}
    return NoiseTerm(effect, comb.pixels * float(np.log(step)), step**2 * ROUNDING_VARIANCE, limits)


def comb_in(evidence: Evidence) -> Comb | None:
    """Returns the coarse steps of the train images' digital numbers; None if all whole numbers occur."""
    whole = evidence.capture.whole
    images = (o.measured if whole is None else whole.ir(o.frame, o.side) for o in evidence.train)
    return comb_of(images, evidence.capture.rig.max_dn)


def _rows(
    observations: Sequence[Observation], effect: Effect, parameter: str, largest_correlation: float, binning: int
) -> NoiseTerm | str:
    """Fits a random offset per row of each frame, by the marginal likelihood of differences between repeats. Returns
    the fit, or a reason why there is none, such as correlated neighbouring rows. binning: number of the camera's rows
    that a row of the observations averages."""
    weight, moment, beside, both = [], [], 0.0, 0.0
    groups = by_repeats((o.frame, o.side, o) for o in observations)
    for first, second in (pair for group in groups for pair in pairwise(group)):
        w = 0.5 * (first.weight + second.weight)
        difference = (first.measured.astype(np.float64) - second.measured) / np.sqrt(2.0)
        weight.append(w.sum(axis=1))
        moment.append((w * difference).sum(axis=1))
        beside += float(moment[-1][1:] @ moment[-1][:-1])
        both += float(weight[-1][1:] @ weight[-1][:-1])
    if not weight:
        return _NO_REPEATS
    A, B = np.concatenate(weight).astype(np.float64), np.concatenate(moment)
    square = _ROW_SIGMAS_DN[:, None] ** 2 / binning
    nats = 0.5 * (B**2 * square / (1.0 + square * A) - np.log1p(square * A)).sum(axis=1)
    best = int(nats.argmax())
    if nats[best] <= 0:
        high = _ROW_SIGMAS_DN[nats > -_LIKELIHOOD_DROP].max(initial=_ROW_SIGMAS_DN[0])
        return NoiseTerm(effect, 0.0, 0.0, {parameter: (0.0, 0.0, float(high))})
    sigma = float(_ROW_SIGMAS_DN[best])
    if beside > largest_correlation * both * sigma**2 / binning:
        return "neighbouring rows vary together, as bands of light that flickers do"
    inside = _ROW_SIGMAS_DN[nats > nats[best] - _LIKELIHOOD_DROP]
    return NoiseTerm(effect, float(nats[best]), sigma**2, {parameter: (sigma, float(inside[0]), float(inside[-1]))})


def _transfer(effect: Effect, term: RandomTerm, evidence: Evidence, model: Model) -> NoiseTerm | str:
    """Fits the variance of repeated frames against their mean, with and without a noise term; other terms are in both
    fits. Returns the fit, or a reason why there is none. Its gain in nats is 0 if the model has no noise term."""
    capture = unbinned(evidence.capture)
    rows = [row for entry in repeat_statistics(capture, "train") for row in transfer_rows(entry, capture.rig.max_dn)]
    if not rows:
        return _NO_REPEATS
    noise = [effect for effect, _ in model.effects if effect.channel is Channel.NOISE_MODEL]
    independent = [t for effect in noise for t in effect.random_terms if t.shared_by is SharedBy.PIXEL]
    stated = [t.lever for t in independent if t.lever in _TRANSFER]
    others = [lever for lever in (stated or _TRANSFER) if lever is not term.lever]
    black = evidence.nuisances.black_dn
    without, _, _ = _fit_levers(rows, others, black)
    misfit, value, error = _fit_levers(rows, [term.lever, *others], black)
    # The coefficient is a variance; the parameter is a deviation, but for photons.
    power = 1.0 if term.lever is Lever.PHOTONS else 0.5
    low, high = (float(max(value + side * Z90 * error, 0.0) ** power) for side in (-1, 1))
    mean = np.average([_column(term.lever, row[0], np.array(row[1]), np.array(row[2]), black) for row in rows])
    nats = 0.5 * (without - misfit) if stated else 0.0
    return NoiseTerm(effect, float(nats), float(value * mean), {term.parameter: (float(value**power), low, high)})


def _column(
    lever: Lever, gain: float | np.ndarray, mean: np.ndarray, square: np.ndarray, black_dn: float
) -> np.ndarray:
    """Returns the variance in DN^2 that a noise term adds per unit of its coefficient, [n]. mean, square: mean and mean
    square of DN, [n]. lever: the signal that the variance grows with."""
    signal = np.maximum(mean - black_dn, 0.0)
    return _TRANSFER[lever](gain, signal, np.maximum(square - 2 * black_dn * mean + black_dn**2, 0.0))


def _fit_levers(
    rows: Sequence[tuple[float, ...]], levers: Sequence[Lever], black_dn: float
) -> tuple[float, float, float]:
    """Fits the variances of repeats by a sum of noise terms, one per lever. Returns (chi2, the first term's
    coefficient, its standard error). rows: as in transfer_rows()."""
    gain, mean, square, variance, weight = np.array(rows).T
    target = variance - ROUNDING_VARIANCE
    if not levers:
        return float(((target * weight) ** 2).sum()), 0.0, 0.0
    terms = np.stack([_column(lever, gain, mean, square, black_dn) for lever in levers], axis=1)
    coefficients, chi2 = fit_terms(terms, target, weight)
    design = terms * weight[:, None]
    norm = np.maximum(np.sqrt((design**2).sum(axis=0)), 1e-300)
    inverse = np.linalg.pinv((design / norm).T @ (design / norm), rcond=1e-12, hermitian=True)
    scale = max(1.0, chi2 / max(len(target) - len(levers), 1))
    return float(chi2), coefficients[0], float(np.sqrt(inverse[0, 0] * scale) / norm[0])
