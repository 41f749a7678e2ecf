# SPDX-License-Identifier: Apache-2.0
"""Backward elimination of parameters: those that hardly improve the fit are set to neutral, and the others are fitted
again.

Two parameters that the data can hardly distinguish would share what belongs to one, and would predict other frames
badly. Only amplitudes are eliminated: a shape parameter at its usual value is no simpler than at another one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from activestereo.diagnose.findings import Explanation
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.diagnose.score.intervals import intervals
from activestereo.diagnose.score.likelihood import cross_validated
from activestereo.diagnose.score.occam import is_shape
from activestereo.diagnose.thresholds import Thresholds

_STEPS = 3


def simplified(
    fitter: Fitter, explanation: Explanation, base_chi2: float, pixels: int, thresholds: Thresholds
) -> Explanation:
    """The explanation without the parameters of its effect that it does not need; itself where it needs them all."""
    share = thresholds.needless_parameter_share * (base_chi2 - explanation.chi2)
    limit = min(share, thresholds.needless_reduced_chi2 * pixels)
    solution, effect = explanation.fitted, explanation.effect
    first = len(solution.theta) - len(effect.parameters)
    amplitudes = [first + i for i, p in enumerate(effect.parameters) if not is_shape(p) and not p.choice]
    fixed = _needless(fitter, solution, amplitudes, limit)
    if not fixed:
        return explanation
    space = solution.space.fixing(fixed)
    step, n = _step_to(fitter, solution, fixed)[1], len(solution.theta)
    theta = np.clip(solution.theta + step[:n], space.low, space.high)
    theta[fixed] = space.neutral[fixed]
    found = fitter.refine(space, theta, solution.phi + step[n:], _STEPS)
    if found.sums.total > solution.sums.total + limit:
        return explanation
    parameters = intervals(fitter, found, effect)
    for i, p in enumerate(effect.parameters):
        if first + i in fixed:
            wide = explanation.parameters[p.name]
            ends = {"low": min(wide.low, p.neutral), "high": max(wide.high, p.neutral)}
            parameters[p.name] = replace(parameters[p.name], value=p.neutral, **ends)
    chi2 = cross_validated(fitter, found)
    return replace(explanation, chi2=chi2, tile_chi2=found.sums.tile_chi2, solution=found, parameters=parameters)


def _needless(fitter: Fitter, solution: Solution, own: Sequence[int], limit: float) -> list[int]:
    """Indices of parameters that may go, cheapest first, at least one stays."""
    fixed: list[int] = []
    while len(fixed) < len(own) - 1:
        costs = {j: _step_to(fitter, solution, [*fixed, j])[0] for j in own if j not in fixed}
        cheapest = min(costs, key=lambda j: costs[j])
        if not costs[cheapest] < limit:
            break
        fixed.append(cheapest)
    return fixed


def _step_to(fitter: Fitter, solution: Solution, fixed: list[int]) -> tuple[float, np.ndarray]:
    """(rise of chi2, step of theta and phi) of the best fit with some parameters neutral, by the linearisation at
    the solution.
    """
    inverse = fitter.inverse(solution)
    away = solution.space.neutral[fixed] - solution.theta[fixed]
    force = np.linalg.pinv(inverse[np.ix_(fixed, fixed)]) @ away
    return float(away @ force), inverse[:, fixed] @ force
