# SPDX-License-Identifier: Apache-2.0
"""Greedy addition: add the best effect that may be named, refit all, remove or swap earlier ones, until nothing
may be named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from activestereo.diagnose.base_fit import BaseFits
from activestereo.diagnose.channels import Progress
from activestereo.diagnose.evidence.repeats import without_drift
from activestereo.diagnose.findings import BaseFit, Finding, Ranking
from activestereo.diagnose.propose.scan import scan_observations
from activestereo.diagnose.rank import Bench, bare_ranking, rank
from activestereo.diagnose.refine import Fitters
from activestereo.diagnose.verdict.acceptance import passes
from activestereo.effects import Effect, Model

# Of a ranking, so many findings after the first may be what an effect added now was mistaken for.
_RIVALS = 3


@dataclass(frozen=True)
class Step:
    """A model along the way: the effects added so far, the ranking that was made on top of it, and what it was made
    with."""

    added: tuple[str, ...]
    ranking: Ranking
    bench: Bench


def greedy(
    bench: Bench, bases: BaseFits, first: Ranking, candidates: Sequence[Effect], progress: Progress | None = None
) -> list[Step]:
    """Steps from the given model on; the last one's model is the answer.

    first: the Ranking on top of the given model.
    """
    gates, given = bench.gates, len(first.base.model.effects)
    steps, ranking = [Step((), first, bench)], first
    tried: set[str] = set()
    rivals: set[str] = set()
    start = first
    while len(steps) <= gates.most_effects:
        passing = [
            f
            for f in ranking.findings
            if f.solution is not None and passes(ranking, f) and _may_be_added(bench, start, ranking, f)
        ]
        best = next((f for f in passing if f.id not in tried), None)
        if best is None:
            break
        tried.add(best.id)
        rivals |= {f.id for f in passing[: 1 + _RIVALS]}
        phi = best.fitted.phi
        grown = _pruned(bench, bases, best.fitted.model, given, phi)
        grown = _swapped(bench, bases, grown, [c for c in candidates if c.id in rivals], given, phi)
        base = bases(grown, phi)
        bench, bases = _without_drift(bench, bases, base)
        base, start = bases(grown, phi), bare_ranking(bench, bases(first.base.model))
        ranking = rank(bench, base, candidates, progress, _fitted_at_first(first, rivals))
        steps.append(Step(tuple(e.id for e, _ in grown.effects[given:]), ranking, bench))
    return steps


def _may_be_added(bench: Bench, start: Ranking, ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding that passes may be added: beside others none that a range's end stopped, which stands in for
    what they left.
    """
    return start is ranking or (not finding.checks.at_range_end and _exceeds_formulas(bench, start, ranking, finding))


def _exceeds_formulas(bench: Bench, start: Ranking, ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding gains more than the formulas of earlier effects may have left of what they explained: in all
    images together, or by a practical size in those that the formulas leave alone, which are none of their fault.

    start: the ranking of the given model by the same weights.
    """
    gates = ranking.gates
    beyond = []
    for o in bench.evidence.train:
        tiles = np.unique(o.tile)
        first, before, after = (
            float(chi2[tiles].sum())
            for chi2 in (start.base.tile_chi2, ranking.base.tile_chi2, finding.explanation.tile_chi2)
        )
        beyond.append(before - after - gates.formulas_share * max(first - before, 0.0))
    return sum(beyond) > 0.0 or sum(max(x, 0.0) for x in beyond) >= gates.smallest_gain_floors * ranking.pixels


def _without_drift(bench: Bench, bases: BaseFits, base: BaseFit) -> tuple[Bench, BaseFits]:
    """The bench and its base fits, with the noise of what is light alone under what was found."""
    expected = {row.observation.key: row.expected for row in (*base.train, *base.test)}
    model, black_dn = base.solution.model, base.solution.nuisances.black_dn
    evidence = without_drift(bench.evidence, model, black_dn, expected, bench.gates.drift_share)
    if evidence is bench.evidence:
        return bench, bases
    scanned, memory = scan_observations(evidence.train, evidence.seed), bench.fitters.train.memory
    fitters = Fitters.of(evidence, scanned, memory, bench.workers)
    return replace(bench, evidence=evidence, fitters=fitters), BaseFits(evidence, fitters, bench.gates)


def _fitted_at_first(first: Ranking, rivals: set[str]) -> dict[str, np.ndarray]:
    """{id: fitted parameters} of the effects that what was added may have been mistaken for."""
    return {f.id: f.solution.values_of(f.effect) for f in first.findings if f.id in rivals and f.solution is not None}


def _loss(bench: Bench, smaller: BaseFit, full: BaseFit) -> tuple[float, float]:
    """(nats, floors) that a base is behind a better one."""
    ranking = bare_ranking(bench, smaller)
    nats = 0.5 * ranking.pixels * float(np.log(smaller.chi2 / full.chi2)) / ranking.design_effect
    return nats, (smaller.chi2 - full.chi2) / ranking.pixels


def _pruned(bench: Bench, bases: BaseFits, model: Model, given: int, phi: np.ndarray) -> Model:
    """The model without those added effects that, all others refitted, it does not need.

    phi: nuisances to start from.
    """
    if len(model.effects) - given < 2:
        return model
    full = bases(model, phi)
    for e, _ in model.effects[given:-1]:
        smaller = model.without_effect(e.id)
        nats, floors = _loss(bench, bases(smaller, phi), full)
        if nats < bench.gates.needless_nats or floors < bench.gates.needless_floors:
            return _pruned(bench, bases, smaller, given, phi)
    return model


def _swapped(
    bench: Bench, bases: BaseFits, model: Model, rivals: Sequence[Effect], given: int, phi: np.ndarray
) -> Model:
    """The model with each earlier effect replaced by the rival that comes first beside the later ones, of which the
    ranking that chose it knew nothing; the last one, too, where what it was chosen beside has changed.
    """
    added = [e for e, _ in model.effects[given:]]
    for e in added:
        kept = {other.id for other, _ in model.effects}
        if e is added[-1] and all(earlier.id in kept for earlier in added[:-1]):
            continue
        model = _with_likeliest(bench, bases, model, e, rivals, phi)
    return model


def _with_likeliest(
    bench: Bench, bases: BaseFits, model: Model, effect: Effect, rivals: Sequence[Effect], phi: np.ndarray
) -> Model:
    """The model with the rival in an effect's place that comes first beside the others, and explains no less."""
    taken = {other.id for other, _ in model.effects} - {effect.id}
    others = rank(bench, bases(model.without_effect(effect.id), phi), [c for c in rivals if c.id not in taken])
    best = next((f for f in others.findings if f.solution is not None), None)
    own = next((f for f in others.findings if f.id == effect.id), None)
    if best is None or own is None or best.chi2 > own.chi2 + bench.gates.needless_floors * others.pixels:
        return model
    return best.fitted.model if best.id != effect.id else model
