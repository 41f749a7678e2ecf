"""What an explanation's freedom costs: Laplace's estimate of its evidence beside its best likelihood (MacKay 2003, chapter 28).

An effect that had to be tuned finely, or far from what its kind usually is, was less to be expected: of two that explain the data
alike, the one that needed less of both comes first. The estimate is good to a few nats, no more.
"""

from itertools import combinations

import numpy as np


def is_shape(parameter):
    """Shape parameters (a focus, a frequency, a doubling temperature) have no neutral value of zero."""
    return parameter.neutral != 0.0


def occam_nats(fitter, entry, deff):
    """log of (prior density at what was found x volume that the data leave) of the parameters of an Entry that has a Solution, less
    what is lost where parameters that it hardly needs are neutral instead: the best choice of those counts. <= 0 but for chance.
    deff: the residuals' design effect."""
    solution, own = entry.solution, len(entry.effect.parameters)
    first = len(solution.theta) - own
    free = first + np.flatnonzero(~(solution.play.held | solution.play.given)[first:])
    if not free.size:
        return 0.0
    parameters = [solution.play.free[i][1] for i in free]
    typical = np.array([p.typical for p in parameters])
    away = (solution.theta[free] - solution.play.neutral[free]) / typical
    density = np.array([_log_density(p, x) for p, x in zip(parameters, away, strict=True)])
    told = _information(fitter, solution, free) * np.outer(typical, typical) / deff
    sizes = range(1, len(free) + 1)
    return max(_choice(list(kept), away, density, told) for size in sizes for kept in combinations(range(len(free)), size))


def choice_nats(fitter, entry):
    """log of the number of choices that were open where an Entry that has a Solution took one: surfaces are two to the power of theirs."""
    solution, own = entry.solution, len(entry.effect.parameters)
    return np.log(2.0) * fitter.materials if solution.theta[-own:][solution.play.given[-own:]].any() else 0.0


def _choice(kept, away, density, told):
    """The cost where only some parameters, `kept`, are in use. away: in typical deviations; told: information in those units."""
    left = np.setdiff1d(np.arange(len(away)), kept)
    across, inner = told[np.ix_(left, kept)], told[np.ix_(kept, kept)]
    loss = away[left] @ (told[np.ix_(left, left)] - across @ np.linalg.pinv(inner, hermitian=True) @ across.T) @ away[left]
    # What the data hardly tell keeps the prior's width.
    volume = np.log(2.0 * np.pi / (1.0 + np.maximum(np.linalg.eigvalsh(inner), 0.0)))
    return float(density[kept].sum() + 0.5 * volume.sum() - 0.5 * max(loss, 0.0))


def _information(fitter, solution, chosen):
    """Of the chosen parameters, all others and the nuisances fitted beside them (Schur's complement)."""
    gram = solution.sums.gram.sum(0) + np.diag(fitter.prior(len(solution.theta), solution.play))
    rest = np.setdiff1d(np.arange(len(gram)), chosen)
    norm = np.sqrt(np.maximum(np.diag(gram)[rest], 1e-300))
    inverse = np.linalg.pinv(gram[np.ix_(rest, rest)] / np.outer(norm, norm), rcond=1e-12, hermitian=True) / np.outer(norm, norm)
    cross = gram[np.ix_(chosen, rest)]
    return gram[np.ix_(chosen, chosen)] - cross @ inverse @ cross.T


def _log_density(parameter, away):
    """Of a parameter's prior per typical deviation: normal for shapes, which physics tells; of amplitudes only the order of magnitude is
    known, so theirs is Cauchy's (Gelman et al. 2008, A weakly informative default prior distribution)."""
    if is_shape(parameter):
        return -0.5 * away**2 - 0.5 * np.log(2.0 * np.pi)
    one_sided = parameter.low >= parameter.neutral or parameter.high <= parameter.neutral
    return np.log((2.0 if one_sided else 1.0) / np.pi) - np.log1p(away**2)
