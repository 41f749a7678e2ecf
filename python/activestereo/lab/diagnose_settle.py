"""The last word on the parameters of what was found: fitted with weights from its own prediction.

A ranking weighs pixels by what it expected before it knew the effect, in part the measurement; such weights have seen the noise
that they weigh, and pull every scale down.
"""

from dataclasses import replace

from activestereo.lab.diagnose_fit import Fitter
from activestereo.lab.diagnose_score import intervals

_ROUNDS = 3


def settled(ranking, entry):
    """A copy of an Entry that has a Solution, its parameters fitted anew; its scores stay those of the ranking."""
    evidence, effect, start = ranking.evidence, entry.effect, entry.solution
    expected = {o.key: image for o, image, *_ in ranking.rows(evidence.train, start)}
    observations = [replace(o, weight=evidence.weight(o, expected[o.key])) for o in evidence.train]
    fitter = Fitter(observations, evidence.held_sigma, evidence.tiles)
    solution = fitter.refine(start.play, start.theta, start.phi, _ROUNDS)
    first = len(start.play.free) - len(effect.parameters)
    found = intervals(fitter, solution, first, effect)
    held = {p.name: entry.parameters[p.name] for p, is_held in zip(effect.parameters, start.play.held[first:], strict=True) if is_held}
    return replace(entry, solution=solution, parameters=found | held)
