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
from activestereo.diagnose.rank import DiagnosisContext, bare_ranking, rank
from activestereo.diagnose.refine import Fitters
from activestereo.diagnose.verdict.acceptance import passes
from activestereo.effects import Effect, Model
from activestereo.effects.core.judging import Channel

# The number of findings after the first for which an added effect may be a confounder.
_RIVALS = 3


@dataclass(frozen=True)
class Step:
    """A model along the way: the effects added so far, the ranking that was made on top of it, what it was made with,
    and the ranking of the given model by the same weights."""

    added: tuple[str, ...]
    ranking: Ranking
    context: DiagnosisContext
    start: Ranking

    def may_add(self, finding: Finding) -> bool:
        """Whether a finding that passes may be added. Beside other effects, one whose shape ended at a limit of its
        range is a confounder of their remaining error, and one has to exceed what their formulas may have left.
        """
        if not self.added:
            return True
        at_end = finding.channel is Channel.EXPECTED_IMAGE and finding.checks.at_range_end
        return not at_end and _exceeds_formulas(self.context, self.start, self.ranking, finding)


def greedy(
    context: DiagnosisContext,
    bases: BaseFits,
    first: Ranking,
    candidates: Sequence[Effect],
    progress: Progress | None = None,
) -> list[Step]:
    """Steps from the given model on; the last one's model is the answer.

    first: the Ranking on top of the given model.
    """
    thresholds, given = context.thresholds, len(first.base.model.effects)
    steps, ranking = [Step((), first, context, first)], first
    tried: set[str] = set()
    rivals: set[str] = set()
    while len(steps) <= thresholds.most_effects:
        passing = [
            f for f in ranking.findings if f.solution is not None and passes(ranking, f) and steps[-1].may_add(f)
        ]
        best = next((f for f in passing if f.id not in tried), None)
        if best is None:
            break
        tried.add(best.id)
        rivals |= {f.id for f in passing[: 1 + _RIVALS]}
        phi = best.fitted.phi
        grown = _pruned(context, bases, best.fitted.model, given, phi)
        grown = _swapped(context, bases, grown, [c for c in candidates if c.id in rivals], given, phi)
        base = bases(grown, phi)
        context, bases = _without_drift(context, bases, base)
        base, start = bases(grown, phi), bare_ranking(context, bases(first.base.model))
        ranking = rank(context, base, candidates, progress, _fitted_at_first(first, rivals))
        steps.append(Step(tuple(e.id for e, _ in grown.effects[given:]), ranking, context, start))
    return steps


def _exceeds_formulas(context: DiagnosisContext, start: Ranking, ranking: Ranking, finding: Finding) -> bool:
    """Whether a finding gains more than the share that inexact formulas of the effects added before may have left: in
    all images together, or by a practical size in those images that these effects do not change. What formulas leave at
    dots and edges looks like draws: fields, which all images share, gain `least_share` of what was explained.

    start: the ranking of the given model by the same weights.
    """
    thresholds, is_of_draws = ranking.thresholds, finding.channel is Channel.STATIC_FIELD
    share = thresholds.least_share if is_of_draws else thresholds.formulas_share
    beyond = []
    for o in context.evidence.train:
        tiles = np.unique(o.tile)
        first, before, after = (
            float(chi2[tiles].sum())
            for chi2 in (start.base.tile_chi2, ranking.base.tile_chi2, finding.explanation.tile_chi2)
        )
        beyond.append(before - after - share * max(first - before, 0.0))
    elsewhere = sum(max(x, 0.0) for x in beyond) >= thresholds.smallest_gain_reduced_chi2 * ranking.pixels
    return sum(beyond) > 0.0 or (elsewhere and not is_of_draws)


def _without_drift(context: DiagnosisContext, bases: BaseFits, base: BaseFit) -> tuple[DiagnosisContext, BaseFits]:
    """The context and its base fits, with the noise estimated without the dark signal and drift that were found."""
    expected = {row.observation.key: row.expected for row in (*base.train, *base.test)}
    model, black_dn = base.solution.model, base.solution.nuisances.black_dn
    evidence = without_drift(context.evidence, model, black_dn, expected, context.thresholds.drift_share)
    if evidence is context.evidence:
        return context, bases
    scanned, memory = scan_observations(evidence.train, evidence.seed), context.fitters.train.memory
    fitters = Fitters.of(evidence, scanned, memory, context.workers)
    return replace(context, evidence=evidence, fitters=fitters), BaseFits(evidence, fitters, context.thresholds)


def _fitted_at_first(first: Ranking, rivals: set[str]) -> dict[str, np.ndarray]:
    """{id: fitted parameters} of the effects for which an added one may be a confounder."""
    return {f.id: f.solution.values_of(f.effect) for f in first.findings if f.id in rivals and f.solution is not None}


def _loss(context: DiagnosisContext, smaller: BaseFit, full: BaseFit) -> tuple[float, float]:
    """(nats, reduced chi-square) that a base is behind a better one."""
    ranking = bare_ranking(context, smaller)
    nats = 0.5 * ranking.pixels * float(np.log(smaller.chi2 / full.chi2)) / ranking.design_effect
    return nats, (smaller.chi2 - full.chi2) / ranking.pixels


def _pruned(context: DiagnosisContext, bases: BaseFits, model: Model, given: int, phi: np.ndarray) -> Model:
    """The model without those added effects that, all others refitted, it does not need.

    phi: nuisances to start from.
    """
    if len(model.effects) - given < 2:
        return model
    full = bases(model, phi)
    for e, _ in model.effects[given:-1]:
        smaller = model.without_effect(e.id)
        nats, reduced_chi2 = _loss(context, bases(smaller, phi), full)
        if nats < context.thresholds.needless_nats or reduced_chi2 < context.thresholds.needless_reduced_chi2:
            return _pruned(context, bases, smaller, given, phi)
    return model


def _swapped(
    context: DiagnosisContext, bases: BaseFits, model: Model, rivals: Sequence[Effect], given: int, phi: np.ndarray
) -> Model:
    """The model with each earlier effect replaced by the rival that ranks first beside the effects added later, which
    were unknown when it was chosen; the last one is replaced too where the effects before it have changed.
    """
    added = [e for e, _ in model.effects[given:]]
    for e in added:
        kept = {other.id for other, _ in model.effects}
        if e is added[-1] and all(earlier.id in kept for earlier in added[:-1]):
            continue
        model = _with_likeliest(context, bases, model, e, rivals, phi)
    return model


def _with_likeliest(
    context: DiagnosisContext, bases: BaseFits, model: Model, effect: Effect, rivals: Sequence[Effect], phi: np.ndarray
) -> Model:
    """The model with an effect replaced by the rival that ranks first beside the others and explains no less."""
    taken = {other.id for other, _ in model.effects} - {effect.id}
    others = rank(context, bases(model.without_effect(effect.id), phi), [c for c in rivals if c.id not in taken])
    best = next((f for f in others.findings if f.solution is not None), None)
    own = next((f for f in others.findings if f.id == effect.id), None)
    if best is None or own is None or best.chi2 > own.chi2 + context.thresholds.needless_reduced_chi2 * others.pixels:
        return model
    return best.fitted.model if best.id != effect.id else model
