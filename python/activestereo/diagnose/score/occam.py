# SPDX-License-Identifier: Apache-2.0
"""The penalty for an explanation's free parameters: Laplace's estimate of its evidence beside its best likelihood
(MacKay 2003, chapter 28).

Of two effects that explain the data equally well, the one that needs less fine tuning and less unusual parameters is
preferred. The estimate is accurate to a few nats.
"""

from itertools import combinations

import numpy as np

from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.effects import Effect, Parameter

# This near to an end of a range, in ranges, a fit was stopped by it.
_NEAR_END = 1e-3


def is_shape(parameter: Parameter) -> bool:
    """Shape parameters (a focus, a frequency, a doubling temperature) have no neutral value of zero."""
    return parameter.neutral != 0.0


def is_at_end(parameter: Parameter, value: float) -> bool:
    """Whether a shape parameter was driven to an end of its range: what it stands for lies beyond its kind. Where the
    neutral value is an end, staying there means nothing."""
    if value == parameter.neutral:
        return False
    room = _NEAR_END * (parameter.high - parameter.low)
    return is_shape(parameter) and not parameter.low + room < value < parameter.high - room


def occam_nats(fitter: Fitter, solution: Solution, effect: Effect, design: float) -> float:
    """The penalty for a fitted effect's free parameters: the logarithm of (prior density at the fitted values x
    posterior volume).

    Parameters may also be neutral, at the cost of the likelihood that this loses; the best such choice counts. The
    result is <= 0 but for chance. design: the residuals' design effect.
    """
    first = len(solution.theta) - len(effect.parameters)
    free = first + np.flatnonzero(~(solution.space.fixed | solution.space.given)[first:])
    if not free.size:
        return 0.0
    parameters = [solution.space.pairs[i][1] for i in free]
    typical = np.array([p.typical for p in parameters])
    away = (solution.theta[free] - solution.space.neutral[free]) / typical
    density = np.array([_log_density(p, x) for p, x in zip(parameters, away, strict=True)])
    information = _information(fitter, solution, free) * np.outer(typical, typical) / design
    sizes = range(1, len(free) + 1)
    kept = (list(chosen) for size in sizes for chosen in combinations(range(len(free)), size))
    return max(_cost(k, away, density, information) for k in kept)


def choice_nats(fitter: Fitter, solution: Solution, effect: Effect) -> float:
    """log of the number of choices that were open where a fitted effect took one: surfaces are two to the power of
    theirs.
    """
    own = slice(len(solution.theta) - len(effect.parameters), None)
    return np.log(2.0) * fitter.materials if solution.theta[own][solution.space.given[own]].any() else 0.0


def _cost(kept: list[int], away: np.ndarray, density: np.ndarray, information: np.ndarray) -> float:
    """The cost where only the parameters `kept` are in use.

    away: distances from neutral in typical deviations; information: in those units.
    """
    used, unused = np.array(kept, dtype=np.int64), np.setdiff1d(np.arange(len(away)), kept)
    across, inner = information[np.ix_(unused, used)], information[np.ix_(used, used)]
    alone = information[np.ix_(unused, unused)] - across @ np.linalg.pinv(inner, hermitian=True) @ across.T
    loss = away[unused] @ alone @ away[unused]
    # What the data hardly tell keeps the prior's width.
    volume = np.log(2.0 * np.pi / (1.0 + np.maximum(np.linalg.eigvalsh(inner), 0.0)))
    return float(density[kept].sum() + 0.5 * volume.sum() - 0.5 * max(loss, 0.0))


def _information(fitter: Fitter, solution: Solution, chosen: np.ndarray) -> np.ndarray:
    """The information on the chosen parameters, all others and the nuisances fitted beside them (Schur's
    complement)."""
    gram = solution.sums.gram.sum(0) + np.diag(fitter.prior(len(solution.theta), solution.space))
    rest = np.setdiff1d(np.arange(len(gram)), chosen)
    cross = gram[np.ix_(chosen, rest)]
    return gram[np.ix_(chosen, chosen)] - cross @ inverse_normal_matrix(gram[np.ix_(rest, rest)]) @ cross.T


def _log_density(parameter: Parameter, away: float) -> float:
    """The log density of a parameter's prior per typical deviation: only the order of magnitude is known, so it is
    Cauchy's (Gelman et al. 2008, A weakly informative default prior distribution)."""
    one_sided = parameter.low >= parameter.neutral or parameter.high <= parameter.neutral
    return np.log((2.0 if one_sided else 1.0) / np.pi) - np.log1p(away**2)
