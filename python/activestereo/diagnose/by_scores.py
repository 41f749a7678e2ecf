# SPDX-License-Identifier: Apache-2.0
"""A diagnosis that scores all effects first and fits the few that matter (search/loop.py)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from activestereo.compare.image_errors import ImageErrors
from activestereo.compare.model_file import model_json
from activestereo.compare.where_channels import surface_text
from activestereo.diagnose.answer.albedo_json import albedo_json
from activestereo.diagnose.answer.by_scores import (
    judging_of,
    parameters_of,
    probabilities_of,
    ranking_of,
    sets_of,
)
from activestereo.diagnose.answer.depth_split import depth_split
from activestereo.diagnose.answer.figures import held_out_figures
from activestereo.diagnose.answer.found_model import found_model
from activestereo.diagnose.answer.geometry_json import geometry_json
from activestereo.diagnose.answer.left_out import left_out_rmse
from activestereo.diagnose.answer.ranking_json import depth_json
from activestereo.diagnose.answer.residual_model import residual_model
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import BaseChecks, BaseFit, Explanation, Finding, Ranking, Score
from activestereo.diagnose.next_measurement import next_measurements
from activestereo.diagnose.numbers import NUMBERS, Numbers
from activestereo.diagnose.rank import DiagnosisContext, rank_depth
from activestereo.diagnose.refine import Fitter, Fitters, ImageResidual, Solution
from activestereo.diagnose.refine.geometry_fit import standing
from activestereo.diagnose.score.likelihood import design_effect, nats_of
from activestereo.diagnose.search.loop import Outcome, Search
from activestereo.diagnose.search.verdict import EFFECT, UNDETERMINED, UNKNOWN, verdict_of
from activestereo.diagnose.settings import Settings
from activestereo.diagnose.verdict.depth import engine_faults
from activestereo.effects import Effect, Model, builtin
from activestereo.effects.core.judging import Channel
from activestereo.effects.core.room_light import has_room_light
from activestereo.effects.core.surfaces import SURFACES
from activestereo.model import SensorModel

_TRAIN = "train"


Examined = tuple[dict[str, Any], Model, str | None, SensorModel, ImageErrors | None, ImageErrors | None]


def examined(
    evidence: Evidence,
    given: Model | SensorModel | None,
    model: Model,
    candidates: Sequence[Effect],
    settings: Settings,
    renders: Callable[[], object],
) -> Examined:
    """(diagnose.json's contents, the model with what was found, the text of an effect or None, model.json's, errors of
    the given model, of model.json), as Diagnosis has them. given: to start from; model: its effects. renders: called
    before the held-out figures are rendered."""
    numbers = replace(NUMBERS, alpha=settings.thresholds.alpha, least_share=settings.thresholds.least_share)
    chosen, out_of_reach = _within_reach(evidence, candidates)
    outcome = _searched(evidence, model, chosen, settings, numbers)
    evidence, names = outcome.evidence, outcome.names
    verdict = verdict_of(outcome.rest, bool(names), evidence.has_floor, numbers)
    is_found = verdict == EFFECT
    solution = outcome.solution if is_found else outcome.first
    rows = outcome.rows if is_found or not names else _rows(evidence, solution)
    accepted = _with_own_functions(solution.model, candidates)
    for name in names if is_found else ():
        if name.field is not None or name.id in outcome.noise:
            found = {key: v.value for key, v in parameters_of(outcome, name).items()}
            accepted = accepted.with_effect(name.effect, **found)
    base, name_of = _base(evidence, solution, rows), surface_text(evidence.capture.scene_path)
    context = _context(evidence, settings, model)
    depth = rank_depth(context, base, candidates)
    faults = engine_faults(depth)[:1]
    for fault in faults:
        found = {key: v.value for key, v in fault.explanation.parameters.items()}
        accepted = accepted.with_effect(fault.effect, **found)
    residual = residual_model(base, evidence.capture.name, evidence.seed) if verdict == UNKNOWN else None
    result: dict[str, Any] = {
        "verdict": verdict,
        "capture": evidence.capture.name,
        "binning": evidence.capture.binning,
        "probabilities": None if verdict == UNDETERMINED else probabilities_of(outcome, numbers),
        "alpha": numbers.alpha,
        "least_share": numbers.least_share,
        "ranking": ranking_of(outcome, numbers, is_found, name_of),
        "sets": sets_of(outcome),
        "own": {},
        "not_ranked": [
            {"effect": e.id, "family": e.family, "reason": reason}
            for e, reason in [*out_of_reach, *((_by_id(candidates, i), why) for i, why in outcome.unjudged.items())]
        ],
        "added": [name.id for name in names] if is_found else [],
        "depth": depth_json(depth, faults, name_of),
        "heldout_ir_rmse_before": left_out_rmse(outcome.fitter, outcome.first),
        "heldout_ir_rmse_geometry": left_out_rmse(outcome.fitter, outcome.first),
        "heldout_ir_rmse_after": left_out_rmse(outcome.fitter, solution),
        "heldout_noise_floor": float(np.sqrt(evidence.floor_variance(evidence.train))) if evidence.has_floor else None,
        "curve": [],
        "depth_split": None,
        "next_measurement": next_measurements(_open_ranking(outcome, context), evidence),
        "geometry": geometry_json(replace(standing(evidence, solution), deviations=evidence.geometry.deviations)),
        "albedos": albedo_json(evidence, outcome.fitter, solution),
        "objects": [],
        "judging": judging_of(outcome),
        "residual_model": residual and residual.as_json(),
        "model": model_json(accepted, solution.nuisances),
    }
    placed = {entry["effect"] for entry in result["ranking"]}
    result["own"] = {e.id: _why(e, result, placed) for e in candidates if _is_own(e)}
    complete = found_model(evidence, accepted, solution, [*_intervals(outcome), *faults])
    errors, before, after = settings.errors, None, None
    if errors is not None:
        renders()
        errors = errors.standing_by(complete)
        figures, before, moved, after = held_out_figures(errors, given, (), (result["added"], complete))
        result |= {name: value for name, value in figures.items() if value is not None}
        plain = errors.plain()
        result["depth_split"] = depth_split(errors.capture, plain, moved, after, depth, name_of, evidence.seed)
    return result, accepted, None if residual is None else residual.stub(), complete, before, after


def _intervals(outcome: Outcome) -> list[Any]:
    """The names as found_model() takes the intervals of."""
    told = ((n.id, SimpleNamespace(parameters=parameters_of(outcome, n))) for n in outcome.names)
    return [SimpleNamespace(id=id, explanation=explanation) for id, explanation in told]


def _searched(
    evidence: Evidence, given: Model, candidates: Sequence[Effect], settings: Settings, numbers: Numbers
) -> Outcome:
    engine, place_of = settings.rendering, settings.located

    def located(model: Model, near: Evidence) -> tuple[Evidence, Any]:
        assert place_of is not None
        place = place_of(_with_own_functions(model, candidates), near)
        there = place.rendering
        return place.evidence, None if there is None else lambda model: there(model, _TRAIN)

    rendering = None if engine is None else lambda model: engine(model, _TRAIN)
    return Search(
        evidence,
        given,
        candidates,
        numbers,
        rendering,
        None if place_of is None else located,
        settings.memory,
        settings.workers,
        settings.looks_like,
    ).run()


def _within_reach(
    evidence: Evidence, candidates: Sequence[Effect]
) -> tuple[list[Effect], list[tuple[Effect, str]]]:
    """(effects that this evidence can judge, the others and why not)."""
    size = evidence.capture.binning
    pixels = f"it acts on single pixels, and the images were averaged over {size}x{size}: judge it with --bin 1"
    room = "it is of single surfaces, and the room was measured as its views' pictures"
    in_room = has_room_light(evidence.capture.scene_path)
    chosen, others = [], []
    for e in candidates:
        if e.channel is None:
            others.append((e, e.unjudged_reason))
        elif size > 1 and e.channel in (Channel.STATIC_FIELD, Channel.NOISE_MODEL):
            others.append((e, pixels))
        elif in_room and SURFACES in e.parameters:
            others.append((e, room))
        else:
            chosen.append(e)
    return chosen, others


def _with_own_functions(model: Model, candidates: Sequence[Effect]) -> Model:
    """The model with its effects' own image functions, in place of rendered ones."""
    own = {e.id: e for e in candidates}
    return Model(tuple((own.get(e.id, e), values) for e, values in model.effects))


def _rows(evidence: Evidence, solution: Solution) -> tuple[ImageResidual, ...]:
    return tuple(Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles).residuals(solution))


def _base(evidence: Evidence, solution: Solution, rows: Sequence[ImageResidual]) -> BaseFit:
    """The fit over whole images."""
    tiles = np.zeros(evidence.tiles)
    for row in rows:
        o = row.observation
        tiles += np.bincount(o.tile.ravel(), (o.weight * row.residual**2).ravel(), minlength=len(tiles))
    return BaseFit(solution.model, solution, float(tiles.sum()), tiles, tuple(rows), (), 0.0)


def _context(evidence: Evidence, settings: Settings, given: Model) -> DiagnosisContext:
    fitters = Fitters.of(evidence, evidence.train[:1], settings.memory, settings.workers)
    ids = frozenset(e.id for e, _ in given.effects)
    return DiagnosisContext(evidence, fitters, settings.thresholds, settings.workers, ids)


def _open_ranking(outcome: Outcome, context: DiagnosisContext) -> Ranking:
    """The first set as the proposal of a next measurement takes it."""
    evidence, base = outcome.evidence, outcome.first
    pixels = sum(o.pixels for o in outcome.fitter.observations)
    tiles = np.bincount(np.concatenate([p.tile for p in outcome.fitter.pixels()]), minlength=evidence.tiles)
    findings = []
    if outcome.names and (seen := outcome.names[0].seen) is not None:
        for id in outcome.names[0].members:
            if id in seen.fits:
                s = seen.fits[id].solution
                nats = nats_of(seen.chi2, s.sums.total, pixels, 1.0)
                gain = (seen.chi2 - s.sums.total) / pixels
                e = Explanation(s.effects[-1], Channel.EXPECTED_IMAGE, {}, s.sums.total, s.sums.tile_chi2, s)
                findings.append(Finding(e, Score(nats, 1.0, gain, 1.0)))
    best = min([base.sums.total, *(f.chi2 for f in findings)])
    design = design_effect(outcome.solution.sums.tile_chi2, tiles)
    fit = BaseFit(base.model, base, base.sums.total, base.sums.tile_chi2, (), (), 0.0)
    return Ranking(fit, BaseChecks(), tuple(findings), (), pixels, design, min(pixels, best), context.thresholds)


def _by_id(candidates: Sequence[Effect], id: str) -> Effect:
    return next(e for e in candidates if e.id == id)


def _is_own(effect: Effect) -> bool:
    return builtin().get(effect.id) is not effect


def _why(effect: Effect, result: dict[str, Any], placed: set[str]) -> str:
    """Why a user's own effect stands where it does."""
    skipped = {entry["effect"]: entry["reason"] for entry in result["not_ranked"]}
    if effect.id in skipped:
        return skipped[effect.id]
    if effect.id in result["added"]:
        return "it explains the data best"
    if effect.id not in placed:
        return "it explains next to nothing of the images"
    gain = next(entry["gain_reduced_chi2"] for entry in result["ranking"] if entry["effect"] == effect.id)
    return f"it may not be named: it explains {gain:.3f} noise variances beside what is likelier"
