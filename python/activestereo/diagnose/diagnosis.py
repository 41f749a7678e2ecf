# SPDX-License-Identifier: Apache-2.0
"""Ranks the library on a capture's train frames and says what the data allow to say.

Test frames are touched once, for the held-out figures of the models along the way; they decide nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.binning import binned, usual_binning, usual_samples
from activestereo.capture.capture import Capture, ImageKey, read_capture
from activestereo.common.computed_once import computed_once
from activestereo.common.input_files import read_json
from activestereo.common.phases import Phases
from activestereo.common.progress_bar import part_of
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import Comparison, RenderedWith, comparison_of
from activestereo.compare.image_errors import ImageErrors
from activestereo.compare.model_file import library, model_json, scene_of
from activestereo.compare.phase_times import megapixels
from activestereo.compare.render import WARP_SCALE, Renderer, render_frames, render_halves
from activestereo.compare.where_channels import surface_text
from activestereo.diagnose import by_scores
from activestereo.diagnose.answer.albedo_json import albedo_json
from activestereo.diagnose.answer.depth_split import depth_split
from activestereo.diagnose.answer.figures import ErrorsOfModels, held_out_figures
from activestereo.diagnose.answer.found_model import found_model
from activestereo.diagnose.answer.geometry_json import geometry_json
from activestereo.diagnose.answer.in_notebook import html_of
from activestereo.diagnose.answer.judging import judging_json
from activestereo.diagnose.answer.posterior import EffectPosterior, posterior_of
from activestereo.diagnose.answer.ranking_json import depth_json, not_ranked_json, own_json, ranking_json
from activestereo.diagnose.answer.residual_model import residual_model
from activestereo.diagnose.answer.told import explained, ranking_figure, sets_told
from activestereo.diagnose.base_fit import BaseFits
from activestereo.diagnose.channels import Progress
from activestereo.diagnose.channels.fields_together import shown_together
from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import BaseFit, Finding, NotRanked, Ranking
from activestereo.diagnose.greedy import Step, greedy
from activestereo.diagnose.next_measurement import next_measurements
from activestereo.diagnose.object_names import object_json, rank_object
from activestereo.diagnose.propose.scan import scan_observations
from activestereo.diagnose.rank import DiagnosisContext, rank, rank_depth, settled_first
from activestereo.diagnose.refine import Fitters
from activestereo.diagnose.refine.by_rendering import Rendering
from activestereo.diagnose.refine.fit_cache import FitCache
from activestereo.diagnose.refine.geometry_fit import gather_where_it_stands, standing
from activestereo.diagnose.refine.parameter_space import Solution
from activestereo.diagnose.room.diagnosed import diagnosed_room, is_measured_room
from activestereo.diagnose.settings import ADDING, BOTH, DEPTH, FITTING, PHASES, RENDERING, Place, Settings
from activestereo.diagnose.thresholds import THRESHOLDS, Thresholds
from activestereo.diagnose.verdict.acceptance import passes
from activestereo.diagnose.verdict.completeness import is_unexplained, lacks_nothing
from activestereo.diagnose.verdict.depth import engine_faults
from activestereo.diagnose.verdict.verdict import EFFECT, UNDETERMINED, UNKNOWN, is_named, probabilities, verdict_of
from activestereo.effects import Effect, Model, builtin
from activestereo.effects.core.judging import Channel
from activestereo.effects.core.scene_surfaces import surface_names
from activestereo.effects.engines.halves import half_samples
from activestereo.model import SensorModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from activestereo.effects.engines import CaptureRenderer

_BASE_SHARE = 0.4  # of the last phase
# Effects that are fitted again where the geometry was searched beside the first one, and the share of chi2 that may be
# lost there: the weights are others.
_AGAIN, _WORSE = 3, 0.01


@dataclass(frozen=True)
class Diagnosis:
    """result: what diagnose.json holds.

    model: the given model with what was added. stub: Python text of an effect, or None. sensor_model: what
    model.json holds; None where the capture's images could not be judged. before, after: the images that the given
    model and model.json expect, with their errors; None where those were not asked for. made: what they were
    rendered with.
    """

    result: dict[str, Any]
    model: Model
    stub: str | None = None
    sensor_model: SensorModel | None = None
    before: ImageErrors | None = None
    after: ImageErrors | None = None
    made: RenderedWith | None = None

    def predictions(self) -> dict[ImageKey, NDArray[np.float32]]:
        """{(frame id, side): DN [height][width]} that model.json expects; empty where no images were judged."""
        return {} if self.after is None else self.after.predictions

    def residuals(self) -> dict[ImageKey, NDArray[np.float32]]:
        """{(frame id, side): measured minus expected DN [height][width]} under model.json."""
        return {} if self.after is None else self.after.residuals()

    def predict(self, frame: int, side: str = "left") -> NDArray[np.float32]:
        """DN [height][width] that model.json expects of a frame. KeyError: no such image was judged."""
        return self.predictions()[frame, side]

    def residual(self, frame: int, side: str = "left") -> NDArray[np.float32]:
        """Measured minus expected DN [height][width] of a frame under model.json. KeyError: as of predict()."""
        return self.residuals()[frame, side]

    def sets(self) -> list[list[str]]:
        """For each name, the effects that this recording cannot tell apart, likeliest first."""
        return sets_told(self.result)

    def explain(self, effect_id: str) -> str:
        """Why an effect was named, or not: a sentence."""
        return explained(self.result, effect_id)

    def plot(self) -> Figure:
        """The gain of each effect of the ranking, as bars."""
        return ranking_figure(self.result)

    @computed_once
    def comparison(self) -> Comparison | None:
        """The Comparison of the model that the diagnosis started from; None where no images were judged. It renders
        nothing, but matches the model's pairs."""
        return None if self.before is None or self.made is None else comparison_of(self.before, self.made)

    def posterior(self) -> dict[str, EffectPosterior]:
        """{effect: how likely it is what is missing, and its parameters}, in the ranking's order."""
        return posterior_of(self.result)

    def _repr_html_(self) -> str:
        """The verdict and the first rows of the ranking, for a notebook."""
        return html_of(self.result)


def diagnose(
    capture_path: str | Path,
    model: Model | SensorModel | None = None,
    effects: Mapping[str, Effect] | None = None,
    steps: str = "one",
    renderer: Renderer | None = None,
    samples_per_pixel: int | None = None,
    max_bounces: int = 8,
    seed: int = 0,
    cache: LayerCache | None = None,
    workers: int = 2,
    progress: Progress | None = None,
    thresholds: Thresholds = THRESHOLDS,
    rendering: Callable[[Capture], Rendering] | None = None,
    engines: Callable[[Capture], CaptureRenderer] | None = None,
    binning: int | None = None,
    scores_first: bool = False,
    looks_like: Callable[[Sequence[str]], object] = lambda names: None,
    reference: Sequence[str | Path] = (),
) -> Diagnosis:
    """A Diagnosis of the capture folder. CaptureError where the capture cannot be used.

    model: to start from; the search takes a SensorModel's effects alone. effects: {id: Effect} to choose from, None for
    the built-in ones. steps: "one" adds the best effect at most, "greedy" goes on until nothing may be named.
    samples_per_pixel: of the held-out figures' images, as compare() has them; the search looks at half as many of its
    own images. progress: called with the fraction done; Phases that begin with PHASES are told of each. rendering:
    makes a capture's engine, by whose images effects of light transport are refined (diagnose/refine/by_rendering.py).
    engines: as of compare(), for the same held-out figures. binning: the search looks at images averaged over so many
    pixels along rows and columns, None for usual_binning(); what is told of the model's images is of whole ones.
    scores_first, looks_like: as of Settings; such a search always goes on until nothing may be named. reference:
    captures of the same unit when it was good, of rooms that `calibrate world` measured.
    """
    effects = library() if effects is None else effects
    reason = no_infrared(capture_path)
    if reason:
        return _undetermined(reason, _effects_of(model, scene_of(capture_path)))
    whole = read_capture(capture_path)
    if is_measured_room(whole):
        known = _effects_of(model, whole.scene_path)
        sessions = [read_capture(path) for path in reference]
        room, found, complete = diagnosed_room(whole, known, list(effects.values()), sessions)
        return Diagnosis(room, found, sensor_model=complete)
    if reference:
        raise ValueError(f"{capture_path}: a reference serves rooms of calibrate world alone: leave it out")
    capture = binned(whole, usual_binning(whole) if binning is None else binning)
    if renderer is None:
        from activestereo.compare.kuafu_renderer import KuafuRenderer

        renderer = KuafuRenderer()
    kept = cache or LayerCache()
    phases = progress if isinstance(progress, Phases) else Phases(progress, PHASES)
    phases.work = megapixels(capture)
    phases.begin(RENDERING)
    searched = half_samples(samples_per_pixel or usual_samples(capture))
    samples_per_pixel = samples_per_pixel or usual_samples(whole)
    sampled: dict[str, Any] = {"samples_per_pixel": searched, "max_bounces": max_bounces}
    sampled |= {"seed": seed, "cache": kept, "progress": phases, "scale": WARP_SCALE}
    known = _effects_of(model, capture.scene_path)
    render = partial(render_frames, renderer=renderer, **sampled)
    made_by = renderer.version, sampled["samples_per_pixel"], max_bounces
    places: list[Place] = []

    def located(model: Model, near: Evidence | None = None) -> Place:
        evidence = gather_where_it_stands(capture, render, model, seed, workers, kept, made_by, near)
        engine = None if rendering is None else rendering(evidence.capture)
        places.append(Place(evidence, engine, FitCache(kept, evidence.train)))
        return places[-1]

    place = located(known)
    told: dict[str, Any] = {"samples_per_pixel": samples_per_pixel, "max_bounces": max_bounces, "seed": seed}
    told |= {"progress": part_of(phases, 0.0, _BASE_SHARE), "scale": WARP_SCALE}
    base = partial(render_halves, renderer=renderer, cache=kept, **told)
    errors = ErrorsOfModels(whole, base, seed, engines, part_of(phases, _BASE_SHARE, 1.0), kept)
    settings = Settings(steps, workers, phases, thresholds, place.rendering, place.memory, errors, located,
                        scores_first, looks_like)
    try:
        diagnosis = examine(place.evidence, model, list(effects.values()), settings)
        return replace(diagnosis, made=RenderedWith(renderer.version, samples_per_pixel, max_bounces, seed))
    finally:
        for place in places:
            place.memory.save()  # what was done before a cancellation need not be done again


def no_infrared(capture_path: str | Path) -> str | None:
    """Why infrared images cannot be judged, or None.

    Depth alone cannot tell one effect from another: nearly all fit it.
    """
    folder = Path(capture_path)
    file = folder if folder.name == "capture.json" else folder / "capture.json"
    if not file.is_file():
        return None  # read_capture says what is wrong
    try:
        frames = read_json(file)["frames"]
        missing = frames and all(frame.get("left") is None and frame.get("right") is None for frame in frames)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return "the capture has no infrared images: depth alone fits nearly every effect" if missing else None


_NO_FIGURES: dict[str, Any] = {
    "heldout_ir_rmse_before": None,
    "heldout_ir_rmse_geometry": None,
    "heldout_ir_rmse_after": None,
    "heldout_noise_floor": None,
    "curve": [],
    "depth_split": None,
}


def _undetermined(reason: str, model: Model) -> Diagnosis:
    text = "record the infrared images of both cameras, with two or more frames of each static view"
    result: dict[str, Any] = {
        "verdict": UNDETERMINED,
        "reason": reason,
        "probabilities": None,
        "ranking": [],
        "added": [],
        **_NO_FIGURES,
        "next_measurement": [{"text": text, "separates": [], "change": None}],
        "residual_model": None,
        "geometry": [],
        "albedos": [],
        "objects": [],
        "depth": {"verdict": UNDETERMINED, "reason": reason, "ranking": [], "added": []},
        "model": model_json(model),
    }
    return Diagnosis(result, model)


def examine(
    evidence: Evidence,
    given: Model | SensorModel | None,
    candidates: Sequence[Effect],
    settings: Settings | None = None,
) -> Diagnosis:
    """diagnose() on gathered evidence."""
    settings = settings or Settings()
    phases, thresholds, errors = settings.phases or Phases(None, PHASES), settings.thresholds, settings.errors
    model = _effects_of(given, evidence.capture.scene_path)
    if all(np.ptp(o.measured) == 0 for o in evidence.train):
        return _undetermined("the infrared images are blank", model)
    phases.begin(FITTING)
    if settings.scores_first:
        return Diagnosis(*by_scores.examined(evidence, given, model, candidates, settings, partial(phases.begin, BOTH)))
    context, bases = _on(evidence, model, settings, settings.rendering, settings.memory)
    first = rank(context, bases(model), candidates, phases)
    phases.begin(ADDING)
    place = None
    if settings.located is not None and _asks_for_geometry(first, evidence):
        # The geometry took what it could of the effect: it is searched again beside what explains the images best.
        place = settings.located(_with_own_functions(first.findings[0].fitted.model, candidates), evidence)
    if place is not None and place.evidence is not evidence:
        there = _on(place.evidence, model, settings, place.rendering, place.memory)
        likely, others = _likely(first, candidates)
        again = rank(there[0], there[1](model), likely)
        if again.best is not None and again.best.chi2 < (1.0 + _WORSE) * first.findings[0].chi2:
            first = replace(again, not_ranked=(*again.not_ranked, *first.not_ranked, *others))
            evidence, (context, bases) = place.evidence, there
    fitters = context.fitters
    if is_named(first):
        first = settled_first(context, first)
    way = _way(context, bases, first, candidates, settings.steps, phases)
    last = way[-1].ranking
    verdict = verdict_of(first, last, evidence.has_floor)
    residual = residual_model(last.base, evidence.capture.name, evidence.seed) if verdict == UNKNOWN else None
    of_object = rank_object(context, first, candidates) if verdict == EFFECT else None
    way, on_top = _accepted(verdict, first, way, settings.steps)
    accepted = _model_of(way[-1].ranking.base.solution.model, on_top)
    phases.begin(DEPTH)
    depth = rank_depth(context, bases(accepted), candidates)
    faults = engine_faults(depth)[:1]
    found, name_of = _model_of(accepted, faults), surface_text(evidence.capture.scene_path)
    solution = _solution_of(way[-1].ranking.base, [*on_top, *faults])
    result: dict[str, Any] = {
        "verdict": verdict,
        "capture": evidence.capture.name,
        "binning": evidence.capture.binning,
        "probabilities": probabilities(first, last, evidence.has_floor),
        "alpha": thresholds.alpha,
        "least_share": thresholds.least_share,
        "ranking": ranking_json(first, name_of),
        "own": own_json(_own(candidates), (first, depth), model),
        "not_ranked": not_ranked_json((*first.not_ranked, *depth.not_ranked)),
        "added": [*way[-1].added, *(f.id for f in on_top)],
        "depth": depth_json(depth, faults, name_of),
        **_NO_FIGURES,
        "next_measurement": next_measurements(first, evidence),
        "geometry": geometry_json(replace(standing(evidence, solution), deviations=evidence.geometry.deviations)),
        "albedos": albedo_json(evidence, fitters.train, solution),
        "objects": [] if of_object is None else [object_json(of_object, context, name_of)],
        "judging": judging_json(first, evidence.has_floor),
        "residual_model": residual and residual.as_json(),
        "model": model_json(found, solution.nuisances),
    }
    found = _with_own_functions(found, candidates)
    complete = found_model(evidence, found, solution, [*first.findings, *faults])
    before = after = None
    if errors is not None:
        phases.begin(BOTH)
        errors = errors.standing_by(complete)
        between = [step for step in way[1:] if list(step.added) != result["added"]]
        models = [(step.added, _found_at(step, evidence, candidates)) for step in between]
        figures, before, moved, after = held_out_figures(errors, given, models, (result["added"], complete))
        result |= figures
        plain = errors.plain()
        result["depth_split"] = depth_split(errors.capture, plain, moved, after, depth, name_of, evidence.seed)
    return Diagnosis(result, found, None if residual is None else residual.stub(), complete, before, after)


def _on(
    evidence: Evidence, model: Model, settings: Settings, rendering: Rendering | None, memory: FitCache | None
) -> tuple[DiagnosisContext, BaseFits]:
    """The context of rankings on evidence, and the base fits there."""
    fitters = Fitters.of(evidence, scan_observations(evidence.train, evidence.seed), memory, settings.workers)
    given = frozenset(e.id for e, _ in model.effects)
    context = DiagnosisContext(evidence, fitters, settings.thresholds, settings.workers, given, rendering)
    return context, BaseFits(evidence, fitters, settings.thresholds)


def _asks_for_geometry(first: Ranking, evidence: Evidence) -> bool:
    """Whether the geometry was corrected without an effect that the images ask for."""
    best = first.best
    if best is None or best.solution is None or evidence.geometry.is_as_stated():
        return False
    return is_named(first) or not first.at_floor


def _likely(first: Ranking, candidates: Sequence[Effect]) -> tuple[list[Effect], list[NotRanked]]:
    """The candidates that may come first where the geometry is another one, and the others."""
    images = sorted((f for f in first.findings if f.solution is not None), key=lambda f: -f.score.nats)
    kept = {f.id for f in images[:_AGAIN]}
    likely = [e for e in candidates if e.channel is not Channel.EXPECTED_IMAGE or e.id in kept]
    reason = "it came nowhere near the first, and was not fitted again where the rig stands"
    ranked = {f.id for f in images}
    return likely, [NotRanked(e, reason) for e in candidates if e not in likely and e.id in ranked]


def _effects_of(given: Model | SensorModel | None, scene_path: Path | None) -> Model:
    return given.bound(surface_names(scene_path)) if isinstance(given, SensorModel) else given or Model()


def _own(candidates: Sequence[Effect]) -> list[Effect]:
    """The candidates that are not the library's."""
    known = builtin()
    return [e for e in candidates if known.get(e.id) is not e]


def _found_at(step: Step, evidence: Evidence, candidates: Sequence[Effect]) -> SensorModel:
    """The model of one step along the way."""
    solution = step.ranking.base.solution
    return found_model(evidence, _with_own_functions(solution.model, candidates), solution, ())


def _with_own_functions(model: Model, candidates: Sequence[Effect]) -> Model:
    """The model with its effects' own image functions, in place of rendered ones."""
    own = {e.id: e for e in candidates}
    return Model(tuple((own.get(e.id, e), values) for e, values in model.effects))


def _way(
    context: DiagnosisContext,
    bases: BaseFits,
    first: Ranking,
    candidates: Sequence[Effect],
    steps: str,
    progress: Progress | None,
) -> list[Step]:
    """Models from the given one on; further ones where they are asked for, or where what is named leaves something."""
    is_whole = not is_named(first) or lacks_nothing(first, first.findings[0])
    if not is_whole and (steps == "greedy" or is_unexplained(first, first.findings[0].remainder, first)):
        return greedy(context, bases, first, candidates, progress)
    return [Step((), first, context, first)]


def _accepted(verdict: str, first: Ranking, way: list[Step], steps: str) -> tuple[list[Step], list[Finding]]:
    """(the steps that count, findings to add on top of the last one's base): no name is claimed where most of the
    error stays.
    """
    if verdict != EFFECT:
        return way[:1], []
    return (way[:1], [first.findings[0]]) if steps == "one" else (way, _without_images_of_their_own(way[-1]))


def _without_images_of_their_own(step: Step) -> list[Finding]:
    """Effects that may still be named at the end though they leave no expected image to continue from: noise, and
    random fields that stay (the best, or those that are shown together).
    """
    ranking = step.ranking
    passing = [f for f in ranking.findings if f.solution is None and passes(ranking, f)]
    fields, noise = ([f for f in passing if f.channel is c] for c in (Channel.STATIC_FIELD, Channel.NOISE_MODEL))
    fields = [f for f in fields if step.may_add(f)]
    if any(lacks_nothing(ranking, f) for f in noise):
        return noise
    together = shown_together(fields, ranking.base, ranking.thresholds) if len(fields) > 1 else []
    if fields and fields[0].id not in {f.id for f in together}:
        together = fields[:1]
    return noise + together


def _solution_of(base: BaseFit, added: Sequence[Finding]) -> Solution:
    """The fit of the nuisances under all that was accepted: of the last finding that has one, else of the base."""
    return next((f.solution for f in reversed(added) if f.solution is not None), base.solution)


def _model_of(model: Model, added: Sequence[Finding]) -> Model:
    """A model, or that of the one fitted finding added to it, with what was added beside."""
    for finding in added:
        if finding.solution is not None:
            model = finding.solution.model
        else:
            values = {name: v.value for name, v in finding.explanation.parameters.items()}
            model = model.with_effect(finding.effect, **values)
    return model
