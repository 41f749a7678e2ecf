"""Greedy addition: add the best effect that passes, refit all, try to remove or swap earlier ones, until nothing passes."""

from dataclasses import dataclass

import numpy as np

from activestereo.lab.diagnose_verdict import passes
from activestereo.lab.ranking import Ranking

_LARGEST_MODEL = 4
# A removal is kept where the model stays as good: its loss of nats is below this; so is a swap that gains more.
_NEEDLESS_NATS = 5.0
_SMALLEST_GAIN_FLOORS = 0.005
# Formulas are approximate: this share of what earlier effects explained may be theirs, too, and asks for no further effect.
_FORMULAS_SHARE = 0.015
# Of a ranking, so many may be what an earlier effect was mistaken for.
_RIVALS = 3
# Share of the first excess that, once gone, leaves nothing worth another ranking.
_ENOUGH = 0.95
# And so much covariance of neighbours in every image, in floors.
_SMOOTH_FLOORS = 0.06


@dataclass
class Step:
    """A model along the way: the effects added so far, and the ranking that was made on top of it."""

    added: tuple
    ranking: object


def greedy(first, evidence, model, candidates, workers, progress=None):
    """Steps from the given model on; the last one's model is the answer. first: the Ranking on top of `model`."""
    steps, ranking, given = [Step((), first)], first, len(model.effects)
    tried, rivals = set(), set()
    while len(steps) <= _LARGEST_MODEL:
        least = _FORMULAS_SHARE * (first.base.chi2 - ranking.base.chi2) / first.pixels
        passing = [e for e in ranking.entries if e.solution is not None and passes(ranking, e) and e.gain_floors > least]
        best = next((e for e in passing if e.id not in tried), None)
        if best is None:
            break
        tried.add(best.id)
        rivals |= {e.id for e in passing[: 1 + _RIVALS]}
        phi = best.solution.phi
        grown = pruned(best.solution.model, evidence, given, phi)
        grown = swapped(grown, evidence, [c for c in candidates if c.id in rivals], given, phi)
        worth_trying = _worth_trying(grown, evidence, first, candidates, phi)
        ranking = Ranking(evidence, grown, worth_trying, workers, progress, _alone(first, rivals), phi)
        steps.append(Step(tuple(e.id for e, _ in grown.effects[given:]), ranking))
    return steps


def _alone(first, rivals):
    """{id: fitted parameters} of the effects that what was added may have been mistaken for."""
    entries = (e for e in first.entries if e.id in rivals and e.solution is not None)
    return {e.id: e.solution.theta[-len(e.effect.parameters) :] for e in entries}


def _worth_trying(model, evidence, first, candidates, phi):
    """No candidates where next to nothing is left in any image; what random effects leave is theirs alone."""
    rest = Ranking(evidence, model, [], phi=phi)
    return [] if rest.excess < (1.0 - _ENOUGH) * first.excess and rest.worst_image < _SMOOTH_FLOORS else candidates


def _loss(ranking, full):
    """Nats and floors that a ranking's base is behind a better base."""
    behind = ranking.base.chi2 / full.chi2
    return 0.5 * ranking.pixels * float(np.log(behind)) / ranking.deff, (ranking.base.chi2 - full.chi2) / ranking.pixels


def pruned(model, evidence, given, phi):
    """The model without those added effects that, all others refitted, it does not need. phi: nuisances to start from."""
    if len(model.effects) - given < 2:
        return model
    full = Ranking(evidence, model, [], phi=phi).base
    for e, _ in model.effects[given:-1]:
        smaller = model.without_effect(e.id)
        nats, floors = _loss(Ranking(evidence, smaller, [], phi=phi), full)
        if nats < _NEEDLESS_NATS or floors < _SMALLEST_GAIN_FLOORS:
            return pruned(smaller, evidence, given, phi)
    return model


def swapped(model, evidence, rivals, given, phi):
    """The model with each earlier effect replaced by the rival that, beside the later ones, explains clearly more."""
    if len(model.effects) - given < 2:
        return model
    for e, _ in model.effects[given:-1]:
        taken = {other.id for other, _ in model.effects} - {e.id}
        others = Ranking(evidence, model.without_effect(e.id), [c for c in rivals if c.id not in taken], phi=phi)
        best = min((r for r in others.entries if r.solution is not None), key=lambda r: r.chi2, default=None)
        own = next((r for r in others.entries if r.id == e.id), None)
        if best is None or own is None:
            continue
        if best.nats - own.nats > _NEEDLESS_NATS and own.chi2 - best.chi2 > _SMALLEST_GAIN_FLOORS * others.pixels:
            model = best.solution.model
    return model
