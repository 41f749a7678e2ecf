# SPDX-License-Identifier: Apache-2.0
"""The channel of random effects that stay: their draws are predicted from one frame to another (field_fit.py)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from activestereo.diagnose.channels.channel import JudgingChannel, Progress
from activestereo.diagnose.channels.field_fit import fit_fields
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import BaseFit, Explanation, FieldFit, NotRanked
from activestereo.diagnose.refine import Fitter, ImageResidual
from activestereo.diagnose.score.intervals import Interval, interval, within_ranges
from activestereo.diagnose.thresholds import Thresholds
from activestereo.effects import Effect
from activestereo.effects.core.judging import Channel, SharedBy


class StaticFieldChannel(JudgingChannel):
    """Judges random effects that stay, on what the base leaves of the infrared images."""

    kind: ClassVar[Channel] = Channel.STATIC_FIELD

    def __init__(self, evidence: Evidence, base: BaseFit, thresholds: Thresholds) -> None:
        self._evidence, self._base, self._thresholds = evidence, base, thresholds

    def explain(self, effects: Sequence[Effect], progress: Progress | None = None) -> list[Explanation | NotRanked]:
        out = []
        for done, effect in enumerate(effects, 1):
            out.append(self._explained(effect))
            if progress:
                progress(done / len(effects))
        return out

    def _explained(self, effect: Effect) -> Explanation | NotRanked:
        lasts_a_view = any(term.shared_by is SharedBy.VIEW for term in effect.random_terms)
        if lasts_a_view and not self._base.white_reduced_chi2:
            return NotRanked(
                effect, "what stays between repeats of a view is not white over the image, as its draws would be"
            )
        black_dn = self._base.solution.nuisances.black_dn
        fit = fit_fields(effect, self._base.train, black_dn, self._thresholds)
        if fit is not None and has_extended_draws(effect):
            fit = fit_fields(effect, self._without_draws(fit), black_dn, self._thresholds)
        if fit is None:
            return NotRanked(effect, "no draws repeat from frame to frame, or what repeats is not random")
        tiles = np.zeros(self._evidence.tiles)
        for (o, *_), r in zip(self._base.train, fit.residuals, strict=True):
            tiles += np.bincount(o.tile.ravel(), (o.weight * r**2).ravel(), minlength=len(tiles))
        return Explanation(effect, self.kind, field_parameters(effect, fit), float(tiles.sum()), tiles, fields=fit)

    def _without_draws(self, fit: FieldFit) -> list[ImageResidual]:
        """The train images under nuisances that are fitted to what the draws leave: a geometry that is fitted without
        them takes what it can of draws larger than a pixel."""
        base, evidence = self._base.solution, self._evidence
        draws = [row.residual - left for row, left in zip(self._base.train, fit.residuals, strict=True)]
        left = [replace(o, measured=o.measured - drawn) for o, drawn in zip(evidence.train, draws, strict=True)]
        fitter = Fitter(left, evidence.nuisance_prior(), evidence.tiles)
        lights = fitter.lights(base.space, base.theta)
        phi, _ = fitter.nuisance_fit(base.space, base.theta, base.phi, lights, 1)
        rows = zip(fitter.residuals(replace(base, phi=phi)), self._base.train, draws, strict=True)
        return [row._replace(observation=o.observation, residual=row.residual + drawn) for row, o, drawn in rows]


def has_extended_draws(effect: Effect) -> bool:
    """Whether pixels that lie together share a draw, which is structure (score/structure.py) until it is predicted."""
    return any(term.shared_by not in (SharedBy.PIXEL, SharedBy.VIEW) for term in effect.random_terms)


def field_parameters(effect: Effect, fit: FieldFit) -> dict[str, Interval]:
    """The parameters of an effect's fields, as fitted."""
    shares = {term.sparse_share for term in effect.random_terms}
    found = {}
    for p in effect.parameters:
        value = fit.share if p.name in shares else fit.sigma.get(p.name, p.neutral)
        found[p.name] = interval(p, float(np.clip(value, p.low, p.high)), fit.error.get(p.name, 0.0))
    return within_ranges(effect, found)
