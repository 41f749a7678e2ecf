# SPDX-License-Identifier: Apache-2.0
"""Ranks candidates on top of a model: every effect is explained on its channel, scored, checked and put in order.

The pipeline has one direction: channels give explanations, which are scored together, the best are simplified and
looked at closely, and the findings are ordered. Nothing goes back.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from activestereo.common.progress_bar import part_of
from activestereo.diagnose.channels import (
    DepthEngineChannel,
    ExpectedImageChannel,
    NoiseLawChannel,
    Progress,
    StaticFieldChannel,
)
from activestereo.diagnose.channels.static_field import has_extended_draws
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import BaseChecks, BaseFit, Explanation, Finding, NotRanked, Ranking, Score
from activestereo.diagnose.refine import Fitters, ImageResidual, Solution
from activestereo.diagnose.refine.by_rendering import Rendering, refined_by_rendering
from activestereo.diagnose.refine.parsimony import simplified
from activestereo.diagnose.refine.settle import settled
from activestereo.diagnose.score.constancy import varying_floors
from activestereo.diagnose.score.likelihood import design_effect, frame_consistency, nats_of
from activestereo.diagnose.score.occam import choice_nats, is_at_end, occam_nats
from activestereo.diagnose.score.steadiness import uneven_structure, unsteady_floors
from activestereo.diagnose.score.structure import local_structure
from activestereo.diagnose.thresholds import Gates
from activestereo.diagnose.verdict.acceptance import comes_near, is_significant, passes
from activestereo.diagnose.verdict.completeness import is_unexplained
from activestereo.diagnose.verdict.confidence import confidences, equivalents
from activestereo.effects import Effect, Stage
from activestereo.effects.core.judging import Channel

# Part of the time that fields of draws take, for the progress.
_FIELDS_TIME = 0.05


@dataclass(frozen=True)
class Bench:
    """What rankings of one capture share.

    given: ids of the effects of the model that the diagnosis started from. rendering: the engine, for what surfaces
    and lights do, whose image functions only propose; None where there is none.
    """

    evidence: Evidence
    fitters: Fitters
    gates: Gates
    workers: int
    given: frozenset[str] = frozenset()
    rendering: Rendering | None = None


def rank(
    bench: Bench,
    base: BaseFit,
    candidates: Sequence[Effect],
    progress: Progress | None = None,
    earlier: Mapping[str, np.ndarray] | None = None,
) -> Ranking:
    """The Ranking of candidates on top of a base.

    earlier: {id: parameters} of effects as fitted before the base's last effect was added (see propose/scan.py).
    """
    known = {e.id for e, _ in base.model.effects}
    of_kind: dict[Channel | None, list[Effect]] = {}
    for e in candidates:
        if e.id not in known:
            of_kind.setdefault(e.channel, []).append(e)
    explained, skipped = _on_images(bench, base, of_kind, progress, earlier)
    ranking = _rendered(bench, _scored(bench, base, explained))
    ranking = _with_findings(ranking, _sized(bench, ranking))
    ranking = _simplified(bench, ranking)
    ranking = _with_findings(ranking, _looked_at(bench, ranking))
    noise, also_skipped = _on_repeats(bench, base, of_kind.get(Channel.NOISE_LAW, []))
    ranking = replace(
        ranking, findings=ranking.findings + noise, not_ranked=(*skipped, *also_skipped, *_unjudged(of_kind))
    )
    ranking = _with_findings(ranking, _in_order(ranking))
    ranking = _with_remainders(bench, ranking)
    return _preferring_what_leaves_no_structure(ranking)


def rank_depth(bench: Bench, base: BaseFit, candidates: Sequence[Effect]) -> Ranking:
    """The Ranking of faults of the depth engine, judged on the device's disparity beside a base: what any matcher
    shows comes last.
    """
    known = {e.id for e, _ in base.model.effects}
    faults = [e for e in candidates if e.channel is Channel.DEPTH_ENGINE and e.id not in known]
    explained, skipped = _split(
        DepthEngineChannel(bench.evidence, base, bench.gates, bench.workers).explain(faults), []
    )
    ranking = replace(bare_ranking(bench, base), not_ranked=tuple(skipped))
    ranking = _with_findings(ranking, (Finding(e, _own_score(e)) for e in explained))
    return _with_findings(ranking, sorted(ranking.findings, key=lambda f: (not passes(ranking, f), -f.score.nats)))


def bare_ranking(bench: Bench, base: BaseFit) -> Ranking:
    """The Ranking of no candidates."""
    return _scored(bench, base, ())


def _on_images(
    bench: Bench,
    base: BaseFit,
    of_kind: Mapping[Channel | None, list[Effect]],
    progress: Progress | None,
    earlier: Mapping[str, np.ndarray] | None,
) -> tuple[list[Explanation], list[NotRanked]]:
    """Explanations on the infrared images: fields of draws, then expected images."""
    fields, images = of_kind.get(Channel.STATIC_FIELD, []), of_kind.get(Channel.EXPECTED_IMAGE, [])
    start = _FIELDS_TIME if fields else 0.0
    out = StaticFieldChannel(bench.evidence, base, bench.gates).explain(fields, part_of(progress, 0.0, start))
    channel = ExpectedImageChannel(bench.fitters, base, bench.gates, bench.workers, earlier)
    out += channel.explain(images, part_of(progress, start, 1.0))
    ranked = {x.effect.id for x in out}
    skipped = [NotRanked(e, "it explains next to nothing of the images") for e in images if e.id not in ranked]
    return _split(out, skipped)


def _on_repeats(bench: Bench, base: BaseFit, effects: Sequence[Effect]) -> tuple[tuple[Finding, ...], list[NotRanked]]:
    """Findings of what expected images cannot show: noise from repeats."""
    explained, skipped = _split(NoiseLawChannel(bench.evidence, base, bench.gates).explain(effects), [])
    return tuple(Finding(e, _own_score(e)) for e in explained), skipped


def _split(
    explained: Iterable[Explanation | NotRanked], skipped: list[NotRanked]
) -> tuple[list[Explanation], list[NotRanked]]:
    ranked = [x for x in explained if isinstance(x, Explanation)]
    return ranked, [x for x in explained if isinstance(x, NotRanked)] + skipped


def settled_first(bench: Bench, ranking: Ranking) -> Ranking:
    """The ranking with the parameters of its first finding settled (diagnose/refine/settle.py), where it has an
    expected image.
    """
    first = ranking.findings[0]
    if first.solution is None:
        return ranking
    explanation = settled(bench.evidence, bench.fitters.train, first.explanation)
    found = replace(first, explanation=explanation)
    structure = local_structure(_rows_after(bench, ranking.base, found))
    variation, held = _variation(bench, found.fitted), _held_sigmas(bench, found.fitted)
    checks = replace(first.checks, structure_floors=structure, variation=variation, held_sigmas=held)
    return _with_findings(ranking, (replace(found, checks=checks), *ranking.findings[1:]))


def _unjudged(of_kind: Mapping[Channel | None, list[Effect]]) -> list[NotRanked]:
    reason = "it is random, and its descriptor does not say how it is judged (see effects/core/judging.py)"
    return [NotRanked(e, reason) for e in of_kind.get(None, [])]


def _scored(bench: Bench, base: BaseFit, explained: Sequence[Explanation]) -> Ranking:
    """A Ranking of explanations on the infrared images, in the order given."""
    fits: list[BaseFit | Explanation] = [base, *explained]
    best = min(fits, key=lambda e: e.chi2)
    pixels = bench.evidence.pixels
    design = design_effect(best.tile_chi2, bench.evidence.tile_pixels)
    floor_chi2 = min(float(pixels), best.chi2)
    findings = tuple(Finding(e, _score(bench, base, e, design, floor_chi2)) for e in explained)
    return Ranking(base, BaseChecks(), findings, (), pixels, design, floor_chi2, bench.gates)


def _score(bench: Bench, base: BaseFit, e: Explanation, design: float, floor_chi2: float) -> Score:
    evidence, fitter = bench.evidence, bench.fitters.train
    fall = base.chi2 - e.chi2
    choice = occam = 0.0
    if e.solution is not None:
        choice = choice_nats(fitter, e.solution, e.effect)
        occam = occam_nats(fitter, e.solution, e.effect, design) - choice
    return Score(
        nats=nats_of(base.chi2, e.chi2, evidence.pixels, design),
        explained_share=fall / max(base.chi2 - floor_chi2, 1e-9),
        gain_floors=fall / evidence.pixels,
        consistency=frame_consistency(evidence.train, base.tile_chi2, e.tile_chi2),
        choice_nats=choice,
        occam_nats=occam,
    )


def _own_score(e: Explanation) -> Score:
    """Of a channel with evidence of its own, whose shares stand for floors."""
    own = e.own
    assert own is not None, e.effect.id
    return Score(own.nats, own.share, own.share, own.consistency, choice_nats=own.surveyed_nats)


def _rendered(bench: Bench, ranking: Ranking) -> Ranking:
    """The ranking with its likeliest effects of light transport refined by the engine's own images: the first,
    then those that still come near it, where they come near the size that a name needs.
    """
    if bench.rendering is None:
        return ranking
    gates = ranking.gates
    least = gates.margin_nats + np.log(max(len(ranking.findings), 1))
    hopeful = [f for f in _by_nats(ranking.findings) if f.solution is not None and f.score.nats > least]
    explained = {f.id: f.explanation for f in ranking.findings}
    for f in hopeful[: gates.rendered]:
        best = max(ranking.base.chi2 - e.chi2 for e in explained.values())
        is_close = ranking.base.chi2 - f.chi2 >= gates.close_share * best
        if _is_transport(f.effect) and is_close and comes_near(ranking, _with_size(bench, ranking, f)):
            explained[f.id] = refined_by_rendering(bench.fitters.train, f.explanation, bench.rendering)
    return _scored(bench, ranking.base, list(explained.values()))


def _is_transport(effect: Effect) -> bool:
    """Whether an effect changes where light goes between projector and camera: there image functions are least
    exact.
    """
    return effect.engine is not None and Stage.MEDIUM <= effect.stage <= Stage.SURFACE


def _with_findings(ranking: Ranking, findings: Iterable[Finding]) -> Ranking:
    return replace(ranking, findings=tuple(findings))


def _by_nats(findings: Iterable[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda f: -f.score.nats)


def _sized(bench: Bench, ranking: Ranking) -> list[Finding]:
    """The findings, the best few with the fall of the error in DN as it is."""
    likely = _by_nats(f for f in ranking.findings if f.solution is not None and is_significant(ranking, f))
    chosen = {f.id for f in likely[: ranking.gates.sized]}
    return [_with_size(bench, ranking, f) if f.id in chosen else f for f in ranking.findings]


def _with_size(bench: Bench, ranking: Ranking, finding: Finding) -> Finding:
    """A finding with the fall of the error in DN as it is."""
    floor, before = _floor_square(bench), _square(ranking.base.train)
    fall = before - _square(bench.fitters.train.residuals(finding.fitted))
    share = fall / max(before - floor, 1e-9 * floor)
    return replace(finding, checks=replace(finding.checks, plain_share=share, plain_floors=fall / floor))


def _simplified(bench: Bench, ranking: Ranking) -> Ranking:
    """The best and those as good as it without needless parameters, alike: such a parameter costs an explanation a
    nat or so.
    """
    gates, fitter = ranking.gates, bench.fitters.train
    passing = [f for f in ranking.findings if f.solution is not None and passes(ranking, f)]
    best = max((f.score.nats for f in passing), default=0.0)
    close = {f.id for f in passing if f.score.nats > best - gates.close_nats}
    if not close:
        return ranking
    findings = [
        simplified(fitter, f.explanation, ranking.base.chi2, ranking.pixels, gates) if f.id in close else f.explanation
        for f in ranking.findings
    ]
    scored = _scored(bench, ranking.base, findings)
    checks = {f.id: f.checks for f in ranking.findings}
    return _with_findings(scored, (replace(f, checks=checks[f.id]) for f in scored.findings))


def _looked_at(bench: Bench, ranking: Ranking) -> list[Finding]:
    """The findings with whether a range stopped their fit, the best few with what their traces explain where they
    may vary.
    """
    likely = _by_nats(f for f in ranking.findings if f.solution is not None and passes(ranking, f))
    chosen = {f.id for f in likely[: ranking.gates.looked_at]}

    def checked(f: Finding) -> Finding:
        at_end = any(is_at_end(p, f.explanation.parameters[p.name].value) for p in f.effect.parameters)
        varying = _varying(bench, f.fitted, f.effect) if f.id in chosen else f.checks.varying_floors
        return replace(f, checks=replace(f.checks, at_range_end=at_end, varying_floors=varying))

    return list(map(checked, ranking.findings))


def _varying(bench: Bench, solution: Solution, effect: Effect) -> float:
    fitter = bench.fitters.train
    return varying_floors(fitter, fitter.residuals(solution), solution, effect)


def _in_order(ranking: Ranking) -> list[Finding]:
    """What may be named first; within each part by gain and simplicity; among what the images name, by confidence."""

    def place(f: Finding) -> tuple[bool, float]:
        return not passes(ranking, f), -f.score.nats - f.score.occam_nats

    findings = sorted(ranking.findings, key=place)
    confidence = confidences(_with_findings(ranking, findings))
    places = [i for i, f in enumerate(findings) if f.on_images and passes(ranking, f)]
    likeliest = sorted((findings[i] for i in places), key=lambda f: -confidence[f.id])
    for i, f in zip(places, likeliest, strict=True):
        findings[i] = f
    return findings


def _with_remainders(bench: Bench, ranking: Ranking) -> Ranking:
    """What the base leaves, and the findings that a verdict may rest on: the first, what cannot be told from it,
    and the one that leaves least.
    """
    passing = [f for f in ranking.findings if f.on_images and passes(ranking, f)]
    matter = set()
    if passing:
        first = ranking.findings[0]
        matter = {first.id, *equivalents(ranking, first), min(passing, key=lambda f: f.chi2).id}
    base_checks = _base_checks(bench, ranking.base)

    def checked(f: Finding) -> Finding:
        if f.id not in matter or not (f.on_images and passes(ranking, f)):
            return f
        structure = local_structure(_rows_after(bench, ranking.base, f))
        solution = f.solution or ranking.base.solution
        held = _held_sigmas(bench, solution)
        variation = base_checks.variation if f.solution is None else _variation(bench, solution)
        return replace(
            f, checks=replace(f.checks, structure_floors=structure, variation=variation, held_sigmas=held)
        )

    return replace(ranking, base_checks=base_checks, findings=tuple(map(checked, ranking.findings)))


def _base_checks(bench: Bench, base: BaseFit) -> BaseChecks:
    return BaseChecks(
        structure_floors=local_structure(base.train),
        variation=_variation(bench, base.solution),
        held_sigmas=_held_sigmas(bench, base.solution),
        plain_excess_floors=_square(base.train) / _floor_square(bench) - 1.0,
        unsteady_floors=unsteady_floors(base.train),
        uneven_structure_floors=uneven_structure(base.train),
    )


def _held_sigmas(bench: Bench, solution: Solution) -> float:
    """How far a solution takes a focal length or an albedo, in deviations. What is named of a surface makes of its
    albedo another quantity than the survey's: beside it nothing is held.
    """
    if any(e.stage is Stage.SURFACE and e.id not in bench.given for e in solution.effects):
        return 0.0
    return bench.fitters.train.held_sigmas(solution)


def _floor_square(bench: Bench) -> float:
    """The sum of squares that noise alone leaves of the train images, DN^2."""
    return sum(bench.evidence.floors[o.key] * o.measured.size for o in bench.evidence.train)


def _variation(bench: Bench, solution: Solution) -> dict[str, float]:
    """{effect: varying_floors} of the effects in a solution that the model did not have when the diagnosis started."""
    return {e.id: _varying(bench, solution, e) for e in solution.effects if e.id not in bench.given}


def _rows_after(bench: Bench, base: BaseFit, finding: Finding) -> Sequence[ImageResidual]:
    """The train images after a finding's expected images, or after its draws where they are larger than a pixel."""
    if finding.solution is not None:
        return bench.fitters.train.residuals(finding.solution)
    fields = finding.explanation.fields
    if fields is None or not has_extended_draws(finding.effect):
        return base.train
    return [row._replace(residual=r) for row, r in zip(base.train, fields.residuals, strict=True)]


def _preferring_what_leaves_no_structure(ranking: Ranking) -> Ranking:
    """Of explanations that cannot be told apart one that leaves structure is none: the next of them that leaves
    none comes first.
    """
    best = ranking.best
    if best is None or not passes(ranking, best) or not is_unexplained(ranking, best.remainder, ranking):
        return ranking
    alike = set(equivalents(ranking, best))
    clean = (f for f in ranking.findings if f.id in alike and passes(ranking, f))
    better = next((f for f in clean if not is_unexplained(ranking, f.remainder, ranking)), None)
    if better is None:
        return ranking
    return _with_findings(ranking, [better, *(f for f in ranking.findings if f is not better)])


def _square(rows: Iterable[ImageResidual]) -> float:
    return float(sum((row.residual.astype(np.float64) ** 2).sum() for row in rows))
