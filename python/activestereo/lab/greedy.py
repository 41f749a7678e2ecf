"""Greedy addition: add the best effect that passes, refit all, try to remove or swap earlier ones, until nothing passes."""

from dataclasses import dataclass

import numpy as np

from activestereo.lab.diagnose_verdict import passes
from activestereo.lab.ranking import Ranking

_LARGEST_MODEL = 5
# A removal is kept where the model stays as good: its loss of nats is below this.
_NEEDLESS_NATS = 5.0
_SMALLEST_GAIN_FLOORS = 0.005


@dataclass
class Step:
    """A model along the way: the effects added so far, and the ranking that was made on top of it."""

    added: tuple
    ranking: object


def greedy(first, evidence, model, candidates, workers, progress=None):
    """Steps from the given model on; the last one's model is the answer. first: the Ranking on top of `model`."""
    steps, ranking, given = [Step((), first)], first, len(model.effects)
    tried = set()
    while len(steps) <= _LARGEST_MODEL:
        best = next((e for e in ranking.entries if e.id not in tried and e.solution is not None and passes(ranking, e)), None)
        if best is None:
            break
        tried.add(best.id)
        grown = pruned(best.solution.model, evidence, candidates, given)
        ranking = Ranking(evidence, grown, candidates, workers, progress)
        steps.append(Step(tuple(e.id for e, _ in grown.effects[given:]), ranking))
    return steps


def pruned(model, evidence, candidates, given):
    """The model without those added effects that, all others refitted, it does not need."""
    if len(model.effects) - given < 2:
        return model
    full = Ranking(evidence, model, [], 1).base
    for e, _ in model.effects[given:-1]:
        smaller = model.without_effect(e.id)
        ranking = Ranking(evidence, smaller, [], 1)
        loss = 0.5 * ranking.pixels * float(np.log(ranking.base.chi2 / full.chi2)) / ranking.deff
        if loss < _NEEDLESS_NATS or ranking.base.chi2 - full.chi2 < _SMALLEST_GAIN_FLOORS * ranking.pixels:
            return pruned(smaller, evidence, candidates, given)
    return model
