# SPDX-License-Identifier: Apache-2.0
"""Turns fits into evidence: the effective number of pixels, and penalties for free parameters.

The penalty is Laplace's estimate of the evidence beside the best likelihood (MacKay 2003, chapter 28), accurate to a
few nats. Of two effects that explain the data equally well, it prefers the one that needs less fine tuning and less
unusual parameters.
"""

from itertools import combinations

import numpy as np

from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.effects import Effect, Parameter


def design_effect(tile_chi2: np.ndarray, tile_pixels: np.ndarray) -> float:
    """Returns by how many times the chi2 of tiles varies more than with independent normal pixels; at least 1. Divided
    by it, the number of pixels becomes the effective number of independent pixels."""
    full = tile_pixels > 0.5 * tile_pixels.max()
    chi2, pixels = tile_chi2[full], tile_pixels[full]
    scale = max(chi2.sum() / pixels.sum(), 1e-12)
    return float(max(1.0, (chi2 / pixels).var() * pixels.mean() / (2.0 * scale**2)))


def occam_nats(fitter: Fitter, solution: Solution, effect: Effect, design: float) -> float:
    """Returns the penalty for a fitted effect's free parameters in nats, to be added to a gain: the logarithm of prior
    density at the fitted values times posterior volume.

    Parameters may also be neutral, at the cost of the likelihood that this loses. The best such choice counts, and all
    choices are equally probable. design: the residuals' design effect.
    """
    first = len(solution.theta) - len(effect.parameters)
    free = first + np.flatnonzero(~solution.space.given[first:])
    if not free.size:
        return 0.0
    parameters = [solution.space.pairs[i][1] for i in free]
    typical = np.array([p.typical for p in parameters])
    away = (solution.theta[free] - solution.space.neutral[free]) / typical
    density = np.array([_log_density(p, x) for p, x in zip(parameters, away, strict=True)])
    information = _information(fitter, solution, free) * np.outer(typical, typical) / design
    sizes = range(1, len(free) + 1)
    kept = (list(chosen) for size in sizes for chosen in combinations(range(len(free)), size))
    peaks = np.array([_log_density(p, 0.0) for p in parameters])
    return max(_cost(k, away, density, information, peaks) for k in kept) - float(np.log(2 ** len(free) - 1))


def _cost(kept: list[int], away: np.ndarray, density: np.ndarray, information: np.ndarray, peaks: np.ndarray) -> float:
    """Returns the penalty, nats, if only the parameters `kept` are in use.

    away: distances from neutral in typical deviations. information: in those units. density, peaks: log prior densities
    at the fitted and at the neutral values.
    """
    used, unused = np.array(kept, dtype=np.int64), np.setdiff1d(np.arange(len(away)), kept)
    across, inner = information[np.ix_(unused, used)], information[np.ix_(used, used)]
    alone = information[np.ix_(unused, unused)] - across @ np.linalg.pinv(inner, hermitian=True) @ across.T
    loss = away[unused] @ alone @ away[unused]
    # Without information a parameter keeps the prior's volume, one over its peak, so that at neutral it costs nothing.
    told = inner + 2.0 * np.pi * np.diag(np.exp(2.0 * peaks[used]))
    volume = len(used) * np.log(2.0 * np.pi) - np.linalg.slogdet(told)[1]
    return float(density[kept].sum() + 0.5 * volume - 0.5 * max(loss, 0.0))


def _information(fitter: Fitter, solution: Solution, chosen: np.ndarray) -> np.ndarray:
    """Returns the information on the chosen parameters with all others and the nuisances fitted too (Schur's
    complement)."""
    gram = solution.sums.gram + np.diag(fitter.prior(len(solution.theta), solution.space))
    rest = np.setdiff1d(np.arange(len(gram)), chosen)
    cross = gram[np.ix_(chosen, rest)]
    return gram[np.ix_(chosen, chosen)] - cross @ inverse_normal_matrix(gram[np.ix_(rest, rest)]) @ cross.T


def _log_density(parameter: Parameter, away: float) -> float:
    """Returns the log density of a parameter's prior per typical deviation, at a distance from neutral in the same
    unit. Only the order of magnitude is known, so the prior is Cauchy's (Gelman et al. 2008, A weakly informative
    default prior distribution)."""
    one_sided = parameter.low >= parameter.neutral or parameter.high <= parameter.neutral
    return np.log((2.0 if one_sided else 1.0) / np.pi) - np.log1p(away**2)
