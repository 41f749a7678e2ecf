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
    NoiseModelChannel,
    Progress,
    StaticFieldChannel,
)
from activestereo.diagnose.channels.static_field import has_extended_draws
from activestereo.diagnose.evidence import Evidence, Observation
from activestereo.diagnose.findings import BaseChecks, BaseFit, Explanation, Finding, NotRanked, Ranking, Score
from activestereo.diagnose.refine import Fitters, ImageResidual, Solution
from activestereo.diagnose.refine.by_rendering import Rendering, refined_by_rendering
from activestereo.diagnose.refine.normal_equations import cluster_of
from activestereo.diagnose.refine.parsimony import simplified
from activestereo.diagnose.refine.settle import settled
from activestereo.diagnose.score.constancy import varying_reduced_chi2
from activestereo.diagnose.score.intervals import share_of_places
from activestereo.diagnose.score.likelihood import design_effect, frame_consistency, nats_of
from activestereo.diagnose.score.occam import choice_nats, is_at_end, occam_nats
from activestereo.diagnose.score.steadiness import uneven_structure, unsteady_reduced_chi2
from activestereo.diagnose.score.structure import local_structure
from activestereo.diagnose.thresholds import Thresholds
from activestereo.diagnose.verdict.acceptance import comes_near, is_significant, passes
from activestereo.diagnose.verdict.completeness import is_unexplained
from activestereo.diagnose.verdict.confidence import confidences, equivalents
from activestereo.effects import Effect, Stage
from activestereo.effects.core.judging import Channel
from activestereo.effects.core.room_light import has_room_light
from activestereo.effects.core.surfaces import SURFACES

# Part of the time that fields of draws take, for the progress.
_FIELDS_TIME = 0.05
# Parts of a ranking's time that have gone after fits, after renders of the likeliest, after checks.
_FITS_TIME, _RENDERED_TIME, _CHECKED_TIME = 0.7, 0.85, 0.95


@dataclass(frozen=True)
class DiagnosisContext:
    """The inputs that rankings of one capture share.

    given: ids of the effects of the model that the diagnosis started from. rendering: the engine, for what surfaces
    and lights do, whose image functions only propose; None where there is none.
    """

    evidence: Evidence
    fitters: Fitters
    thresholds: Thresholds
    workers: int
    given: frozenset[str] = frozenset()
    rendering: Rendering | None = None


def rank(
    context: DiagnosisContext,
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
    tell = progress or (lambda fraction: None)
    out_of_reach = _of_pixels(context, of_kind) + _of_surfaces(context, of_kind)
    explained, skipped = _on_images(context, base, of_kind, part_of(progress, 0.0, _FITS_TIME), earlier)
    ranking = _rendered(context, scored(context, base, explained))
    tell(_RENDERED_TIME)
    ranking = _with_findings(ranking, _sized(context, ranking))
    ranking = _simplified(context, ranking)
    ranking = _with_findings(ranking, _looked_at(context, ranking))
    tell(_CHECKED_TIME)
    noise, also_skipped = _on_repeats(context, base, of_kind.get(Channel.NOISE_MODEL, []))
    ranking = replace(
        ranking,
        findings=ranking.findings + noise,
        not_ranked=(*skipped, *also_skipped, *out_of_reach, *_unjudged(of_kind)),
    )
    ranking = _with_findings(ranking, _in_order(ranking))
    ranking = _with_remainders(context, ranking)
    return _preferring_what_leaves_no_structure(ranking)


def rank_depth(context: DiagnosisContext, base: BaseFit, candidates: Sequence[Effect]) -> Ranking:
    """The Ranking of faults of the depth engine, judged on the device's disparity on top of a base; differences that
    depend on the matcher alone come last.
    """
    known = {e.id for e, _ in base.model.effects}
    faults = [e for e in candidates if e.channel is Channel.DEPTH_ENGINE and e.id not in known]
    explained, skipped = _split(
        DepthEngineChannel(
            context.evidence, base, context.thresholds, context.workers, context.fitters.train.memory
        ).explain(faults),
        [],
    )
    ranking = replace(bare_ranking(context, base), not_ranked=tuple(skipped))
    ranking = _with_findings(ranking, (Finding(e, _own_score(e)) for e in explained))
    return _with_findings(ranking, sorted(ranking.findings, key=lambda f: (not passes(ranking, f), -f.score.nats)))


def bare_ranking(context: DiagnosisContext, base: BaseFit) -> Ranking:
    """The Ranking of no candidates."""
    return scored(context, base, ())


def _on_images(
    context: DiagnosisContext,
    base: BaseFit,
    of_kind: Mapping[Channel | None, list[Effect]],
    progress: Progress | None,
    earlier: Mapping[str, np.ndarray] | None,
) -> tuple[list[Explanation], list[NotRanked]]:
    """Explanations on the infrared images: fields of draws, then expected images."""
    fields, images = of_kind.get(Channel.STATIC_FIELD, []), of_kind.get(Channel.EXPECTED_IMAGE, [])
    start = _FIELDS_TIME if fields else 0.0
    out = StaticFieldChannel(context.evidence, base, context.thresholds).explain(fields, part_of(progress, 0.0, start))
    channel = ExpectedImageChannel(context.fitters, base, context.thresholds, context.workers, earlier)
    out += channel.explain(images, part_of(progress, start, 1.0))
    ranked = {x.effect.id for x in out}
    skipped = [NotRanked(e, "it explains next to nothing of the images") for e in images if e.id not in ranked]
    return _split(out, skipped)


def _on_repeats(
    context: DiagnosisContext, base: BaseFit, effects: Sequence[Effect]
) -> tuple[tuple[Finding, ...], list[NotRanked]]:
    """Findings of what expected images cannot show: noise from repeats."""
    explained, skipped = _split(NoiseModelChannel(context.evidence, base, context.thresholds).explain(effects), [])
    return tuple(Finding(e, _own_score(e)) for e in explained), skipped


def _split(
    explained: Iterable[Explanation | NotRanked], skipped: list[NotRanked]
) -> tuple[list[Explanation], list[NotRanked]]:
    ranked = [x for x in explained if isinstance(x, Explanation)]
    return ranked, [x for x in explained if isinstance(x, NotRanked)] + skipped


def settled_first(context: DiagnosisContext, ranking: Ranking) -> Ranking:
    """The ranking with the parameters of its first finding settled (diagnose/refine/settle.py), where it has an
    expected image.
    """
    first = ranking.findings[0]
    if first.solution is None:
        return ranking
    explanation = settled(context.evidence, context.fitters.train, first.explanation)
    found = replace(first, explanation=explanation)
    structure = local_structure(_rows_after(context, ranking.base, found))
    held = _prior_sigmas(context, found.fitted, ranking.base)
    checks = replace(first.checks, structure_reduced_chi2=structure, prior_sigmas=held)
    return _with_findings(ranking, (replace(found, checks=checks), *ranking.findings[1:]))


def _of_pixels(context: DiagnosisContext, of_kind: dict[Channel | None, list[Effect]]) -> list[NotRanked]:
    """Effects on single pixels, taken out of those that are judged where images are averages of several pixels."""
    size = context.evidence.capture.binning
    if size == 1:
        return []
    reason = f"it acts on single pixels, and the images were averaged over {size}x{size}: judge it with --bin 1"
    channels = Channel.STATIC_FIELD, Channel.NOISE_MODEL
    return [NotRanked(e, reason) for channel in channels for e in of_kind.pop(channel, [])]


def _of_surfaces(context: DiagnosisContext, of_kind: Mapping[Channel | None, list[Effect]]) -> list[NotRanked]:
    """Effects of chosen materials, taken out where a room was measured: there a view's picture is one material."""
    images = of_kind.get(Channel.EXPECTED_IMAGE, [])
    chosen = [e for e in images if SURFACES in e.parameters]
    if not chosen or not has_room_light(context.evidence.capture.scene_path):
        return []
    images[:] = [e for e in images if e not in chosen]
    return [NotRanked(e, "it is of single surfaces, and the room was measured as its views' pictures") for e in chosen]


def _unjudged(of_kind: Mapping[Channel | None, list[Effect]]) -> list[NotRanked]:
    return [NotRanked(e, e.unjudged_reason) for e in of_kind.get(None, [])]


def scored(context: DiagnosisContext, base: BaseFit, explained: Sequence[Explanation]) -> Ranking:
    """A Ranking of explanations on the infrared images, in the order given."""
    fits: list[BaseFit | Explanation] = [base, *explained]
    best = min(fits, key=lambda e: e.chi2)
    pixels = context.evidence.pixels
    design = design_effect(best.tile_chi2, context.evidence.tile_pixels)
    noise_chi2 = min(float(pixels), best.chi2)
    findings = tuple(Finding(e, _score(context, base, e, design, noise_chi2)) for e in explained)
    return Ranking(base, BaseChecks(), findings, (), pixels, design, noise_chi2, context.thresholds)


def _score(context: DiagnosisContext, base: BaseFit, e: Explanation, design: float, noise_chi2: float) -> Score:
    evidence, fitter = context.evidence, context.fitters.train
    fall = base.chi2 - e.chi2
    choice = occam = 0.0
    if e.solution is not None:
        choice = choice_nats(fitter, e.solution, e.effect)
        occam = occam_nats(fitter, e.solution, e.effect, design) - choice
    return Score(
        nats=nats_of(base.chi2, e.chi2, evidence.pixels, design),
        explained_share=fall / max(base.chi2 - noise_chi2, 1e-9),
        gain_reduced_chi2=fall / evidence.pixels,
        consistency=frame_consistency(evidence.train, base.tile_chi2, e.tile_chi2),
        choice_nats=choice,
        occam_nats=occam,
    )


def _own_score(e: Explanation) -> Score:
    """The score on a channel with evidence of its own, whose shares take the place of noise variances."""
    own = e.own
    assert own is not None, e.effect.id
    return Score(own.nats, own.share, own.share, own.consistency, choice_nats=own.pose_error_nats)


def _rendered(context: DiagnosisContext, ranking: Ranking) -> Ranking:
    """The ranking with its likeliest effects of light transport refined by the engine's own images: the first,
    then those that still come near it, where they come near the size that a name needs.
    """
    if context.rendering is None:
        return ranking
    thresholds = ranking.thresholds
    least = thresholds.chance_nats(len(ranking.findings))
    hopeful = [f for f in _by_nats(ranking.findings) if f.solution is not None and f.score.nats > least]
    explained = {f.id: f.explanation for f in ranking.findings}
    for f in hopeful[: thresholds.rendered]:
        best = max(ranking.base.chi2 - e.chi2 for e in explained.values())
        is_close = ranking.base.chi2 - f.chi2 >= thresholds.close_share * best
        if _is_transport(f.effect) and is_close and comes_near(ranking, _with_size(context, ranking, f)):
            explained[f.id] = refined_by_rendering(context.fitters.train, f.explanation, context.rendering)
    return scored(context, ranking.base, list(explained.values()))


def _is_transport(effect: Effect) -> bool:
    """Whether an effect changes where light goes between projector and camera: there image functions are least
    exact.
    """
    return effect.engine is not None and Stage.MEDIUM <= effect.stage <= Stage.SURFACE


def _with_findings(ranking: Ranking, findings: Iterable[Finding]) -> Ranking:
    return replace(ranking, findings=tuple(findings))


def _by_nats(findings: Iterable[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda f: -f.score.nats)


def _sized(context: DiagnosisContext, ranking: Ranking) -> list[Finding]:
    """The findings; the best few with the decrease of the unweighted error in DN."""
    likely = _by_nats(f for f in ranking.findings if f.solution is not None and is_significant(ranking, f))
    chosen = {f.id for f in likely[: ranking.thresholds.sized]}
    return [_with_size(context, ranking, f) if f.id in chosen else f for f in ranking.findings]


def _with_size(context: DiagnosisContext, ranking: Ranking, finding: Finding) -> Finding:
    """A finding with the decrease of the unweighted error in DN."""
    train, floors = context.evidence.train, _floors(context)
    before, after = (
        np.concatenate([_squares_of_tiles(row) for row in rows])
        for rows in (ranking.base.train, context.fitters.train.residuals(finding.fitted))
    )
    floor = np.concatenate([value * _tiles(o) / o.tile.size for value, o in zip(floors, train, strict=True)])
    share, low = share_of_places(before - after, before - floor, _places(train))
    fall = float((before - after).sum() / floors.sum())
    sized = {"plain_share": share, "plain_share_low": low, "plain_reduced_chi2": fall}
    return replace(finding, checks=replace(finding.checks, **sized))


def _simplified(context: DiagnosisContext, ranking: Ranking) -> Ranking:
    """The best finding and those close to it, all without needless parameters, each of which costs a nat or so."""
    thresholds, fitter = ranking.thresholds, context.fitters.train
    passing = [f for f in ranking.findings if f.solution is not None and passes(ranking, f)]
    best = max((f.score.nats for f in passing), default=0.0)
    close = {f.id for f in passing if f.score.nats > best - thresholds.close_nats}
    if not close:
        return ranking
    findings = [
        simplified(fitter, f.explanation, ranking.base.chi2, ranking.pixels, thresholds)
        if f.id in close
        else f.explanation
        for f in ranking.findings
    ]
    simpler = scored(context, ranking.base, findings)
    checks = {f.id: f.checks for f in ranking.findings}
    return _with_findings(simpler, (replace(f, checks=checks[f.id]) for f in simpler.findings))


def _looked_at(context: DiagnosisContext, ranking: Ranking) -> list[Finding]:
    """The findings with whether a shape ended at a limit of its range; those that may be named also with what a varying
    amplitude explains."""

    def checked(f: Finding) -> Finding:
        at_end = any(is_at_end(p, f.explanation.parameters[p.name].value) for p in f.effect.parameters)
        may_be_named = f.solution is not None and passes(ranking, f)
        varying = _varying(context, f.fitted, f.effect) if may_be_named else f.checks.varying_reduced_chi2
        return replace(f, checks=replace(f.checks, at_range_end=at_end, varying_reduced_chi2=varying))

    return list(map(checked, ranking.findings))


def _varying(context: DiagnosisContext, solution: Solution, effect: Effect) -> float:
    fitter = context.fitters.train
    return varying_reduced_chi2(fitter, fitter.residuals(solution), solution, effect)


def _in_order(ranking: Ranking) -> list[Finding]:
    """Findings that may be named come first; within each part by gain and simplicity; among what the images name, by
    confidence."""

    def place(f: Finding) -> tuple[bool, float]:
        return not passes(ranking, f), -f.score.nats - f.score.occam_nats

    findings = sorted(ranking.findings, key=place)
    confidence = confidences(_with_findings(ranking, findings))
    places = [i for i, f in enumerate(findings) if f.on_images and passes(ranking, f)]
    likeliest = sorted((findings[i] for i in places), key=lambda f: -confidence[f.id])
    for i, f in zip(places, likeliest, strict=True):
        findings[i] = f
    return findings


def _with_remainders(context: DiagnosisContext, ranking: Ranking) -> Ranking:
    """The ranking with the checks of the base and of the findings that a verdict may rest on: the first, those that
    cannot be distinguished from it, and the one with the least remaining error.
    """
    passing = [f for f in ranking.findings if f.on_images and passes(ranking, f)]
    matter = set()
    if passing:
        first = ranking.findings[0]
        matter = {first.id, *equivalents(ranking, first), min(passing, key=lambda f: f.chi2).id}
    base_checks = _base_checks(context, ranking.base)

    def checked(f: Finding) -> Finding:
        if f.id not in matter or not (f.on_images and passes(ranking, f)):
            return f
        solution = f.solution or ranking.base.solution
        checks = replace(
            f.checks,
            structure_reduced_chi2=local_structure(_rows_after(context, ranking.base, f)),
            prior_sigmas=_prior_sigmas(context, solution, ranking.base),
        )
        return replace(f, checks=checks)

    return replace(ranking, base_checks=base_checks, findings=tuple(map(checked, ranking.findings)))


def _base_checks(context: DiagnosisContext, base: BaseFit) -> BaseChecks:
    return BaseChecks(
        structure_reduced_chi2=local_structure(base.train),
        prior_sigmas=context.fitters.train.prior_sigmas(base.solution),
        plain_excess_reduced_chi2=float(_squares(base.train).sum() / _floors(context).sum()) - 1.0,
        unsteady_reduced_chi2=unsteady_reduced_chi2(base.train),
        uneven_structure_reduced_chi2=uneven_structure(base.train),
    )


def _prior_sigmas(context: DiagnosisContext, solution: Solution, base: BaseFit) -> float:
    """How much farther than the base a solution takes what is stated of geometry and albedos, in deviations. What is
    named of a surface makes of its albedo another quantity than the measured one: beside it no prior counts.
    """
    if any(e.stage is Stage.SURFACE and e.id not in context.given for e in solution.effects):
        return 0.0
    return context.fitters.train.prior_sigmas(solution, base.solution)


def _floors(context: DiagnosisContext) -> np.ndarray:
    """The sum of squares that noise alone leaves of each train image, DN^2."""
    return np.array([context.evidence.noise_variances[o.key] * o.pixels for o in context.evidence.train])


def _rows_after(context: DiagnosisContext, base: BaseFit, finding: Finding) -> Sequence[ImageResidual]:
    """The train images after a finding's expected images, or after its draws where they are larger than a pixel."""
    if finding.solution is not None:
        return context.fitters.train.residuals(finding.solution)
    fields = finding.explanation.fields
    if fields is None or not has_extended_draws(finding.effect):
        return base.train
    return [row._replace(residual=r) for row, r in zip(base.train, fields.residuals, strict=True)]


def _preferring_what_leaves_no_structure(ranking: Ranking) -> Ranking:
    """The ranking with the best explanation that leaves no structure first, where the first one leaves some and the two
    cannot be distinguished."""
    best = ranking.best
    if best is None or not passes(ranking, best) or not is_unexplained(ranking, best.remainder, ranking):
        return ranking
    alike = set(equivalents(ranking, best))
    clean = (f for f in ranking.findings if f.id in alike and passes(ranking, f))
    better = next((f for f in clean if not is_unexplained(ranking, f.remainder, ranking)), None)
    if better is None:
        return ranking
    return _with_findings(ranking, [better, *(f for f in ranking.findings if f is not better)])


def _squares_of_tiles(row: ImageResidual) -> np.ndarray:
    """The sum of squares of each tile of an image, DN^2."""
    tile = row.observation.tile
    return np.bincount((tile - tile.min()).ravel(), row.residual.astype(np.float64).ravel() ** 2)


def _tiles(o: Observation) -> np.ndarray:
    """The pixels of each tile of an image."""
    return np.bincount((o.tile - o.tile.min()).ravel())


def _places(train: Sequence[Observation]) -> np.ndarray:
    """Numbers of what the tiles of each image show, which repeats of one camera's view share."""
    clusters = list(dict.fromkeys(map(cluster_of, train)))
    most = max(len(_tiles(o)) for o in train)
    return np.concatenate([clusters.index(cluster_of(o)) * most + np.arange(len(_tiles(o))) for o in train])


def _squares(rows: Iterable[ImageResidual]) -> np.ndarray:
    """The sum of squares of each image, DN^2."""
    return np.array([(row.residual.astype(np.float64) ** 2).sum() for row in rows])
