# SPDX-License-Identifier: Apache-2.0
"""The names of one object. Where an effect of some surfaces is named, all that may be so of these surfaces is fitted to
them alone and refined by the engine's images: gloss, light below the surface and light that passes, of the library, and
another albedo and a metal (effects/core/object_rivals.py). What fits as well is told, with the view that separates it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from activestereo.diagnose.answer.ranking_json import Json, parameters_json
from activestereo.diagnose.findings import BaseFit, Checks, Explanation, Finding, Ranking
from activestereo.diagnose.next_measurement import separating_view
from activestereo.diagnose.rank import DiagnosisContext, scored
from activestereo.diagnose.refine import ParameterSpace, Solution
from activestereo.diagnose.refine.by_rendering import refined_by_rendering
from activestereo.diagnose.score.intervals import intervals
from activestereo.diagnose.score.likelihood import cross_validated
from activestereo.diagnose.score.occam import is_at_end
from activestereo.diagnose.verdict.confidence import equivalents
from activestereo.effects import Effect
from activestereo.effects.core.judging import Channel
from activestereo.effects.core.object_rivals import RIVALS
from activestereo.effects.core.surfaces import SURFACES, material_numbers

# Starts of an amplitude, in typical deviations from neutral, and the fits' steps on few images and on all.
_STARTS = (-1.0, 0.5, 1.0, 3.0)
_SCAN_STEPS, _STEPS = 5, 6


def surfaces_of(finding: Finding) -> float | None:
    """The bits of the materials that a finding's effect acts on, 0: all; None where it does not choose."""
    if finding.solution is None or SURFACES not in finding.effect.parameters:
        return None
    return finding.explanation.parameters[SURFACES.name].value


def rank_object(context: DiagnosisContext, first: Ranking, candidates: Sequence[Effect]) -> Ranking | None:
    """The Ranking of all that may be so of the surfaces of the first finding's effect; None where it has none."""
    best = first.findings[0] if first.findings else None
    surfaces = None if best is None else surfaces_of(best)
    if best is None or surfaces is None:
        return None
    known = {f.id: f for f in first.findings}
    own = [e for e in candidates if SURFACES in e.parameters and e.channel is Channel.EXPECTED_IMAGE]
    rivals = {e.id: e for e in (*RIVALS, *own) if e.id != best.id and e.id not in context.given}.values()
    worth_chi2 = first.base.chi2 - context.thresholds.close_share * (first.base.chi2 - best.chi2)
    fits = (_explanation(context, first.base, e, surfaces, known.get(e.id), worth_chi2) for e in rivals)
    explained = [best.explanation, *fits]
    ranking = scored(context, first.base, explained)
    findings = sorted(map(_checked, ranking.findings), key=lambda f: -f.score.nats - f.score.occam_nats)
    return replace(ranking, findings=tuple(findings))


def object_json(ranking: Ranking, context: DiagnosisContext, name_of: Callable[[int], str]) -> Json:
    """An entry of diagnose.json's `objects`."""
    best, *others = ranking.findings
    materials = [name_of(k) for k in material_numbers(surfaces_of(best) or 0.0)]
    alike = equivalents(ranking, best)
    open_set = replace(ranking, findings=tuple(f for f in ranking.findings if f.id in {best.id, *alike}))
    view = separating_view(open_set, context.evidence) if alike else None
    return {
        "materials": materials,
        "rendered": context.rendering is not None,
        "names": [
            {
                "effect": f.id,
                "finding": f.effect.finding,
                "score_nats": f.score.nats,
                "parameters": parameters_json(f, name_of),
            }
            for f in ranking.findings
        ],
        "equivalent": alike,
        "view": view,
        "text": _text(materials, best, others, alike, view),
    }


def _text(
    materials: Sequence[str], best: Finding, others: Sequence[Finding], alike: Sequence[str], view: Json | None
) -> str:
    """A sentence without its full stop."""
    said = f"on {', '.join(materials) or 'all surfaces'} {best.id} explains most ({best.score.nats:.0f} nats)"
    if alike:
        apart = "no recorded view separates them: record it from other sides and distances"
        return f"{said}, and {', '.join(alike)} as much; {view['text'] if view else apart}"
    behind = [f"; next comes {f.id}, {best.score.nats - f.score.nats:.0f} nats behind" for f in others[:1]]
    return said + "".join(behind)


def _explanation(
    context: DiagnosisContext,
    base: BaseFit,
    effect: Effect,
    surfaces: float,
    known: Finding | None = None,
    worth_chi2: float = np.inf,
) -> Explanation:
    """The best fit of an effect of these surfaces. known: its finding on any. worth_chi2: as of refined_by_rendering().
    """
    space = ParameterSpace.of(base.model, effect).starting_at(base.solution.theta)
    given = [surfaces if p.name == SURFACES.name else p.neutral for p in effect.parameters]
    amplitude = effect.parameters[0]
    moved = [float(np.clip(amplitude.neutral + k * amplitude.typical, amplitude.low, amplitude.high)) for k in _STARTS]
    starts = [[value, *given[1:]] for value in dict.fromkeys(moved) if value != amplitude.neutral]
    if known is not None and known.solution is not None:
        found = known.fitted.values_of(known.effect)
        starts.append([g if p.choice else v for p, g, v in zip(effect.parameters, given, found, strict=True)])
    thetas = [np.concatenate([base.solution.theta, start]) for start in starts]
    scan, train = context.fitters.scan, context.fitters.train
    fits = [scan.refine(space, theta, base.solution.phi, _SCAN_STEPS) for theta in thetas]
    near = min(fits, key=lambda fit: fit.sums.total)
    explanation = _of(context, effect, train.refine(space, near.theta, near.phi, _STEPS))
    if context.rendering is None:
        return explanation
    refined = [refined_by_rendering(train, explanation, context.rendering, worth_chi2)]
    if explanation.chi2 >= base.chi2:  # the image function sees nothing, which the engine need not believe
        typical = np.concatenate([base.solution.theta, [amplitude.typical_value, *given[1:]]])
        proposed = _of(context, effect, train.refine(space, typical, base.solution.phi, 0))
        refined.append(refined_by_rendering(train, proposed, context.rendering, worth_chi2))
    return min(refined, key=lambda e: e.chi2)


def _of(context: DiagnosisContext, effect: Effect, solution: Solution) -> Explanation:
    train = context.fitters.train
    found, chi2 = intervals(train, solution, effect), cross_validated(train, solution)
    return Explanation(effect, Channel.EXPECTED_IMAGE, found, chi2, solution.sums.tile_chi2, solution=solution)


def _checked(finding: Finding) -> Finding:
    """The finding with whether a shape of it ended at a limit of its range."""
    parameters = finding.explanation.parameters
    at_end = any(is_at_end(p, parameters[p.name].value) for p in finding.effect.parameters)
    return replace(finding, checks=Checks(at_range_end=at_end))
