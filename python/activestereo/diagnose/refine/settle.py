# SPDX-License-Identifier: Apache-2.0
"""The final fit of an explanation's parameters, with weights from its own prediction.

The weights of a ranking come from images expected before the effect was known, mixed with the measurement. Such weights
depend on the noise that they weigh and bias every scale downwards.
"""

from dataclasses import replace

from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import Explanation
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.score.intervals import intervals

_ROUNDS = 3


def settled(evidence: Evidence, fitter: Fitter, explanation: Explanation) -> Explanation:
    """An Explanation that has a Solution, its parameters fitted again; its chi2 stays that of the ranking.

    fitter: of the train images.
    """
    effect, start = explanation.effect, explanation.fitted
    observations = [replace(o, weight=evidence.weight(o, expected)) for o, expected, *_ in fitter.residuals(start)]
    sized = evidence.nuisance_prior(), evidence.tiles
    own_weights = Fitter(observations, *sized, memory=fitter.memory, threads=fitter.threads)
    solution = own_weights.refine(start.space, start.theta, start.phi, _ROUNDS)
    found = intervals(own_weights, solution, effect)
    fixed = start.space.fixed[len(start.theta) - len(effect.parameters) :]
    kept = {
        p.name: explanation.parameters[p.name] for p, is_fixed in zip(effect.parameters, fixed, strict=True) if is_fixed
    }
    return replace(explanation, solution=solution, parameters=found | kept)
