# SPDX-License-Identifier: Apache-2.0
"""Records of the models along the way of a diagnosis."""

from collections.abc import Iterator, Sequence

import numpy as np

from activestereo.diagnose.channels.fields_together import shown_together
from activestereo.diagnose.channels.static_field import has_extended_draws
from activestereo.diagnose.decision.records import Findings, ModelRecord
from activestereo.diagnose.findings import BaseFit, Finding
from activestereo.diagnose.greedy import Step
from activestereo.diagnose.rank import DiagnosisContext
from activestereo.diagnose.refine import ImageResidual, Solution
from activestereo.diagnose.score.constancy import varying_reduced_chi2
from activestereo.diagnose.score.left_out import left_out_by_view, view_of, views
from activestereo.diagnose.score.occam import freedom_of
from activestereo.diagnose.score.steadiness import unsteady_reduced_chi2
from activestereo.diagnose.score.structure import local_structure
from activestereo.diagnose.verdict.acceptance import passes
from activestereo.effects.core.judging import Channel

# All is recorded of so many models of a ranking, the likeliest.
_WHOLE = 6


def findings_of(way: Sequence[Step], has_floor: bool) -> Findings:
    """The Findings of a diagnosis' steps."""
    first, evidence = way[0].ranking, way[0].context.evidence
    base = first.base
    squares = sum(float((row.residual.astype(np.float64) ** 2).sum()) for row in base.train)
    floor = sum(evidence.noise_variances[o.key] * o.pixels for o in evidence.train)
    last = way[-1].ranking
    fields = [f for f in last.findings if f.channel is Channel.STATIC_FIELD and passes(last, f)]
    together = shown_together(fields, last.base, last.thresholds) if len(fields) > 1 else []
    return Findings(
        white=base.white_reduced_chi2,
        unsteady=unsteady_reduced_chi2(base.train),
        plain=squares / floor - 1.0,
        tried=len(first.findings) + len(first.not_ranked),
        has_floor=has_floor,
        independent=first.pixels / len(views(evidence.train)) / first.design_effect,
        together=tuple(f.id for f in together),
        models=tuple(record for step in way for record in _records(step)),
    )


def _records(step: Step) -> Iterator[ModelRecord]:
    """The base of a step and what was found on top of it."""
    ranking, context = step.ranking, step.context
    base, design = ranking.base, ranking.design_effect
    whole = _whole(context, base.solution, base.train, design)
    yield ModelRecord(step.added, "", _by_view(context, base.tile_chi2), **whole)  # type: ignore[arg-type]
    likeliest = sorted((f for f in ranking.findings if f.on_images), key=lambda f: -f.score.nats)[:_WHOLE]
    for f in ranking.findings:
        e, own, more = f.explanation, f.explanation.own, {}
        rows = _rows_after(context, base, f) if any(f is one for one in likeliest) else None
        if rows is not None:
            more = _whole(context, f.solution, rows, design)
        yield ModelRecord(
            (*step.added, f.id),
            f.channel.value,
            _by_view(context, e.tile_chi2),
            rounding=e.repeats_reduced_chi2,
            own_nats=None if own is None else own.nats - own.pose_error_nats,
            own_share=0.0 if own is None else own.share,
            choice_nats=f.score.choice_nats,
            closed_low=f.checks.plain_share_low,
            **more,  # type: ignore[arg-type]
        )


def _whole(
    context: DiagnosisContext, solution: Solution | None, rows: Sequence[ImageResidual], design: float
) -> dict[str, object]:
    """The part of a record that takes long to compute. rows: the train images under the model. solution: None of a
    field."""
    train, fitter = context.evidence.train, context.fitters.train
    of_view = [[row for row in rows if view_of(row.observation) == view] for view in views(train)]
    known: dict[str, object] = {"structure": tuple(map(local_structure, of_view))}
    if solution is None:
        return known
    added = [e for e in solution.effects if e.id not in context.given]
    left_out = left_out_by_view(fitter, solution)
    pixels = [sum(row.observation.pixels for row in view) for view in of_view]
    return known | {
        "left_out": tuple(chi2 / count for chi2, count in zip(left_out, pixels, strict=True)),
        "varying": sum(varying_reduced_chi2(fitter, rows, solution, e) for e in added),
        "strain": fitter.strain(solution),
        "freedom": freedom_of(fitter, solution, added, design),
    }


def _by_view(context: DiagnosisContext, tile_chi2: np.ndarray) -> tuple[float, ...]:
    """The mean square of each view."""
    train, out = context.evidence.train, []
    for view in views(train):
        own = [o for o in train if view_of(o) == view]
        out.append(float(sum(tile_chi2[np.unique(o.tile)].sum() for o in own) / sum(o.pixels for o in own)))
    return tuple(out)


def _rows_after(context: DiagnosisContext, base: BaseFit, f: Finding) -> Sequence[ImageResidual] | None:
    """The train images after a finding's expected images, or after its draws where they are larger than a pixel; None
    of other draws."""
    if f.solution is not None:
        return context.fitters.train.residuals(f.solution)
    fields = f.explanation.fields
    if fields is None or not has_extended_draws(f.effect):
        return None
    return [row._replace(residual=r) for row, r in zip(base.train, fields.residuals, strict=True)]
