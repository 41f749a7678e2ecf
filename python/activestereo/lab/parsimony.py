"""Parameters that an explanation does not need: set to neutral where that costs next to nothing, the others fitted anew.

Two parameters that the data can hardly tell apart otherwise share what belongs to one, and foretell other frames badly. Only
amplitudes can be absent: a focus at its usual place is no simpler than one elsewhere, and holding it there would shift the rest.
"""

from copy import copy
from dataclasses import replace

import numpy as np

from activestereo.lab.diagnose_occam import is_shape
from activestereo.lab.diagnose_score import cross_validated, intervals

# What leaving a parameter out may cost: of what the effect explains, and in floors.
_COST_SHARE, _COST_FLOORS = 0.03, 0.005
_STEPS = 3


def simplified(fitter, entry, base_chi2, pixels):
    """The entry without the parameters of its effect that it does not need; itself where it needs them all."""
    limit = min(_COST_SHARE * (base_chi2 - entry.chi2), _COST_FLOORS * pixels)
    solution, own = entry.solution, len(entry.effect.parameters)
    first = len(solution.theta) - own
    absent = [first + i for i, p in enumerate(entry.effect.parameters) if not is_shape(p) and not p.choice]
    held = _needless(fitter, solution, absent, limit)
    if not held:
        return entry
    play = copy(solution.play)
    play.held = play.held.copy()
    play.held[held] = True
    step = _step_to(fitter, solution, held)[1]
    n = len(solution.theta)
    theta = np.clip(solution.theta + step[:n], play.low, play.high)
    theta[held] = play.neutral[held]
    found = fitter.refine(play, theta, solution.phi + step[n:], _STEPS)
    if found.sums.total > solution.sums.total + limit:
        return entry
    told = intervals(fitter, found, first, entry.effect)
    for i, p in enumerate(entry.effect.parameters):
        if first + i in held:
            wide = entry.parameters[p.name]
            told[p.name] |= {"value": p.neutral, "low": min(wide["low"], p.neutral), "high": max(wide["high"], p.neutral)}
    return replace(entry, chi2=cross_validated(fitter, found), tile_chi2=found.sums.tile_chi2, solution=found, parameters=told)


def _needless(fitter, solution, own, limit):
    """Indices of parameters that may go, cheapest first, at least one stays."""
    held = []
    while len(held) < len(own) - 1:
        costs = {j: _step_to(fitter, solution, [*held, j])[0] for j in own if j not in held}
        cheapest = min(costs, key=costs.get)
        if not costs[cheapest] < limit:
            break
        held.append(cheapest)
    return held


def _step_to(fitter, solution, held):
    """(rise of chi2, step of theta and phi) of the best fit with some parameters neutral, by the linearisation at the solution."""
    gram = solution.sums.gram.sum(0) + np.diag(fitter.prior(len(solution.theta), solution.play))
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inverse = np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-12, hermitian=True) / np.outer(norm, norm)
    away = solution.play.neutral[held] - solution.theta[held]
    force = np.linalg.pinv(inverse[np.ix_(held, held)]) @ away
    return float(away @ force), inverse[:, held] @ force
