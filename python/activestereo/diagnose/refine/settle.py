# SPDX-License-Identifier: Apache-2.0
"""The last word on the parameters of what was found: fitted with weights from its own prediction.

A ranking weighs pixels by what it expected before it knew the effect, in part the measurement; such weights have seen
the noise that they weigh, and pull every scale down.
"""

from dataclasses import replace

from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import Explanation
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.score.intervals import intervals

_ROUNDS = 3


def settled(evidence: Evidence, fitter: Fitter, explanation: Explanation) -> Explanation:
    """An Explanation that has a Solution, its parameters fitted anew; its chi2 stays that of the ranking.

    fitter: of the train images.
    """
    effect, start = explanation.effect, explanation.fitted
    observations = [replace(o, weight=evidence.weight(o, expected)) for o, expected, *_ in fitter.residuals(start)]
    sized = evidence.prior_sigma, evidence.tiles
    own_weights = Fitter(observations, *sized, memory=fitter.memory, threads=fitter.threads)
    solution = own_weights.refine(start.space, start.theta, start.phi, _ROUNDS)
    found = intervals(own_weights, solution, effect)
    fixed = start.space.fixed[len(start.theta) - len(effect.parameters) :]
    kept = {
        p.name: explanation.parameters[p.name] for p, is_fixed in zip(effect.parameters, fixed, strict=True) if is_fixed
    }
    return replace(explanation, solution=solution, parameters=found | kept)
