# SPDX-License-Identifier: Apache-2.0
"""Records of the models along the way of a diagnosis."""

from collections.abc import Iterator, Sequence

import numpy as np

from activestereo.diagnose.decision.records import Findings, ModelRecord
from activestereo.diagnose.findings import Finding, Ranking
from activestereo.diagnose.greedy import Step
from activestereo.diagnose.rank import DiagnosisContext
from activestereo.diagnose.refine import Fitter, ImageResidual, Solution
from activestereo.diagnose.refine.light import SCALES
from activestereo.diagnose.score.constancy import varying_reduced_chi2
from activestereo.diagnose.score.left_out import left_out_by_view, view_of, views
from activestereo.diagnose.score.occam import freedom_of
from activestereo.diagnose.score.structure import image_structure

# Of so many models of a ranking, the likeliest, all is recorded.
_LOOKED_AT = 6


def findings_of(way: Sequence[Step], has_floor: bool) -> Findings:
    """The Findings of a diagnosis' steps."""
    first = way[0].ranking
    evidence, checks = way[0].context.evidence, first.base_checks
    pixels = [sum(o.pixels for o in evidence.train if view_of(o) == view) for view in views(evidence.train)]
    return Findings(
        pixels=tuple(pixels),
        white=first.base.white_reduced_chi2,
        unsteady=checks.unsteady_reduced_chi2,
        uneven=checks.uneven_structure_reduced_chi2,
        tried=len(first.findings) + len(first.not_ranked),
        has_floor=has_floor,
        models=tuple(record for step in way for record in _records(step)),
    )


def _records(step: Step) -> Iterator[ModelRecord]:
    """The base of a step and what was found on top of it."""
    ranking, context = step.ranking, step.context
    base = ranking.base
    yield _recorded(context, step.added, base.solution, base.train, base.chi2, base.tile_chi2)
    likeliest = sorted((f for f in ranking.findings if f.on_images), key=lambda f: -f.score.nats)[:_LOOKED_AT]
    for f in ranking.findings:
        yield _of_finding(context, ranking, step.added, f, any(f is one for one in likeliest))


def _of_finding(
    context: DiagnosisContext, ranking: Ranking, added: tuple[str, ...], f: Finding, whole: bool
) -> ModelRecord:
    """The record of a finding; what takes long only where it is asked for whole."""
    e, own = f.explanation, f.explanation.own
    rows: Sequence[ImageResidual] | None = None
    if whole:
        rows = ranking.base.train if f.solution is None else context.fitters.train.residuals(f.fitted)
    solution = f.solution if whole else None
    return _recorded(
        context,
        (*added, f.id),
        solution,
        rows,
        f.chi2,
        e.tile_chi2,
        channel=f.channel.value,
        rounding=e.repeats_reduced_chi2,
        own_nats=None if own is None else own.nats - own.pose_error_nats,
        own_share=0.0 if own is None else own.share,
        closed_low=f.checks.plain_share_low,
        at_range_end=f.checks.at_range_end,
        choice_nats=f.score.choice_nats,
    )


def _recorded(
    context: DiagnosisContext,
    effects: tuple[str, ...],
    solution: Solution | None,
    rows: Sequence[ImageResidual] | None,
    chi2: float,
    tile_chi2: np.ndarray,
    channel: str = "",
    **known: object,
) -> ModelRecord:
    fitter, train = context.fitters.train, context.evidence.train
    of_view = {view: 0.0 for view in views(train)}
    for o in train:
        of_view[view_of(o)] += float(tile_chi2[np.unique(o.tile)].sum())
    if solution is not None:
        added = [e for e in solution.effects if e.id not in context.given]
        assert rows is not None
        known |= {
            "view_left_out": tuple(left_out_by_view(fitter, solution)),
            "varying": sum(varying_reduced_chi2(fitter, rows, solution, e) for e in added),
            "strain": _strain(fitter, context, solution),
            "freedom": freedom_of(fitter, solution, added),
        }
    structure = None if rows is None else tuple(map(image_structure, rows))
    return ModelRecord(effects, channel, chi2, tuple(of_view.values()), structure=structure, **known)  # type: ignore[arg-type]


def _strain(fitter: Fitter, context: DiagnosisContext, solution: Solution) -> float:
    prior = context.evidence.nuisance_prior()
    return float((((solution.phi[SCALES:] - prior.value) / prior.sigma) ** 2).sum())
