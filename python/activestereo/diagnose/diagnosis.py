# SPDX-License-Identifier: Apache-2.0
"""Searches a capture's train frames for effects that its model lacks, and reports the verdict that the data allow.

Test frames give the held-out errors of the given model and of the found model. They never choose an effect. If they do
not confirm a verdict, it becomes `unknown`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from activestereo.capture.capture import Capture, ImageKey, binned, read_capture, usual_binning, usual_samples
from activestereo.common.computed_once import computed_once
from activestereo.common.phases import Phases
from activestereo.common.progress_bar import Progress
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import Comparison, RenderedWith, comparison_of
from activestereo.compare.engine_prediction import engine_changes, engines_of
from activestereo.compare.image_errors import ImageErrors
from activestereo.compare.render import BaseRenders, LayersOfFrames, Renderer
from activestereo.diagnose.depth_engine import Depth, depth_json, judged_depth
from activestereo.diagnose.depth_split import depth_split
from activestereo.diagnose.evidence import Evidence, Observation
from activestereo.diagnose.fields import draws_growth
from activestereo.diagnose.figures import NOTHING_TOLD, ErrorsOfModels, held_out_figures, left_out_rmse, without_light
from activestereo.diagnose.fitter import Fitter, Solution
from activestereo.diagnose.found_model import albedo_json, found_model, geometry_json
from activestereo.diagnose.gather import no_infrared
from activestereo.diagnose.geometry import Geometry
from activestereo.diagnose.geometry_search import gather_where_it_stands, standing, with_test_frames
from activestereo.diagnose.goodness import design_effect, excess_of
from activestereo.diagnose.kept import FitCache, keep, key_of
from activestereo.diagnose.kept import kept as found_before
from activestereo.diagnose.next_measurement import next_measurements
from activestereo.diagnose.numbers import NUMBERS, Numbers
from activestereo.diagnose.outcome import Outcome
from activestereo.diagnose.ranking import judging_of, parameters_of, probabilities_of, ranking_of, sets_of
from activestereo.diagnose.refit import Rendering, restore_functions
from activestereo.diagnose.residual_model import effect_stub, residual_model
from activestereo.diagnose.search import Search
from activestereo.diagnose.selection import first_words
from activestereo.diagnose.settings import BOTH, DEPTH, FITTING, PHASES, RENDERING, Settings
from activestereo.diagnose.verdict import EFFECT, UNDETERMINED, UNKNOWN, verdict_of
from activestereo.diagnose.words import explained, headline, html_of, ranking_figure, rival_words
from activestereo.effects import Effect, Model, builtin
from activestereo.effects.core.surfaces import SURFACES, surface_names, surface_text
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects.engines.loaded_scene import has_room_light, is_measured_room
from activestereo.model import SensorModel
from activestereo.model.library import find, library, model_json, scene_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from activestereo.diagnose.room.unseen import Unseen


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """The answer of diagnose(). result: the contents of diagnose.json.

    model: the given model with the effects that were found. stub: Python text of a new effect, or None. sensor_model:
    the contents of model.json; None if the images could not be judged. before, after: the images that the given model
    and model.json predict, with their errors; None if not asked for. made: the renderer and settings of these images.
    kept_as: the cache key of the diagnosis; None if a model was given or an effect is a user's own. unseen: for a
    measured room, one view predicted from its other views under the given and under the found model.
    """

    result: dict[str, Any]
    model: Model
    stub: str | None = None
    sensor_model: SensorModel | None = None
    before: ImageErrors | None = None
    after: ImageErrors | None = None
    made: RenderedWith | None = None
    kept_as: str | None = None
    unseen: tuple[Unseen, Unseen] | None = None

    def predictions(self) -> dict[ImageKey, NDArray[np.float32]]:
        """Returns {(frame id, side): DN [height][width]} as model.json expects them; empty if no images were judged."""
        return {} if self.after is None else self.after.predictions

    def residuals(self) -> dict[ImageKey, NDArray[np.float32]]:
        """Returns {(frame id, side): measured minus expected DN [height][width]} under model.json; empty if none were
        judged."""
        return {} if self.after is None else self.after.residuals()

    def predict(self, frame: int, side: str = "left") -> NDArray[np.float32]:
        """Returns the image [height][width] in DN that model.json predicts for a frame. Raises KeyError if that image
        was not judged."""
        return _image_of(self.predictions(), frame, side)

    def residual(self, frame: int, side: str = "left") -> NDArray[np.float32]:
        """Returns measured minus predicted image [height][width] in DN under model.json. Raises KeyError if that image
        was not judged."""
        return _image_of(self.residuals(), frame, side)

    def sets(self) -> list[list[str]]:
        """Returns one list of effect ids for each named effect. It holds the named effect and those that explain the
        recording equally well, most probable first."""
        return [list(s["effects"]) for s in self.result["sets"]]

    def explain(self, effect_id: str) -> str:
        """Returns a sentence on why an effect was named, or why not. Raises ValueError for an unknown effect."""
        find({**library(), **dict.fromkeys(self.result.get("own", ()))}, effect_id)
        return explained(self.result, effect_id)

    def plot(self) -> Figure:
        """Returns a bar chart of the gain of each effect in the ranking."""
        return ranking_figure(self.result)

    @computed_once
    def comparison(self) -> Comparison | None:
        """Returns the Comparison for the model that the diagnosis started from; None if no images were judged. It
        renders nothing, but runs the stereo matcher on the model's image pairs."""
        return None if self.before is None or self.made is None else comparison_of(self.before, self.made)

    def __repr__(self) -> str:
        return "\n".join([headline(self.result), *rival_words(self.result)])

    def _repr_html_(self) -> str:
        """Returns the verdict and the first rows of the ranking as HTML, for a notebook."""
        return html_of(self.result)


def _image_of(images: Mapping[ImageKey, NDArray[np.float32]], frame: int, side: str) -> NDArray[np.float32]:
    if (frame, side) not in images:
        raise KeyError(f"frame {frame}, {side} was not judged: there are {sorted(images)}")
    return images[frame, side]


def diagnose(
    capture_path: str | Path,
    model: Model | SensorModel | None = None,
    effects: Mapping[str, Effect] | None = None,
    renderer: Renderer | None = None,
    samples_per_pixel: int | None = None,
    max_bounces: int = 8,
    seed: int = 0,
    cache: LayerCache | None = None,
    workers: int = 2,
    progress: Progress | None = None,
    numbers: Numbers = NUMBERS,
    rendering: Callable[[Capture], Rendering] | None = None,
    engines: Callable[[Capture], CaptureRenderer] | None = None,
    binning: int | None = None,
    says: Callable[[str], object] | None = None,
    reference: Sequence[str | Path] = (),
) -> Diagnosis:
    """Diagnoses a capture folder and returns the Diagnosis. Raises CaptureError if the capture cannot be used.

    model: the model to start from; of a SensorModel the search uses only the effects. effects: {id: Effect} to choose
    from, None for the built-in ones. samples_per_pixel: of the path tracer, for the search and the held-out errors;
    None = usual_samples(). progress: called with the fraction done; a Phases that begins with PHASES is told of each
    phase. rendering: makes a capture's render engine, to which effects of light transport are fitted
    (diagnose/refit.py); None = kuafu if renderer is None, else formulas. engines: as in compare(), for the held-out
    errors. binning: the search averages blocks of
    binning x binning pixels, None for usual_binning(); held-out errors use full-size images. says: called with progress
    texts. The first one names the likeliest effects, unless a cached diagnosis answers; further ones are as in
    Settings. reference: captures of the same unit from when it worked well, only for rooms that `calibrate world`
    measured (else ValueError).
    """
    effects = library() if effects is None else effects
    candidates = list(effects.values())
    reason = no_infrared(capture_path)
    if reason:
        return _undetermined(reason, _effects_of(model, scene_of(capture_path)))
    whole = read_capture(capture_path)
    whole.check_train()
    whole.check_scene()
    if is_measured_room(whole):
        from activestereo.diagnose.room.diagnosed import diagnosed_room  # half of all imports' time

        known = _effects_of(model, whole.scene_path)
        sessions = [read_capture(path) for path in reference]
        room, found, complete, unseen = diagnosed_room(whole, known, effects, sessions)
        return Diagnosis(room, found, sensor_model=complete, unseen=unseen)
    if reference:
        raise ValueError(f"{capture_path}: a reference serves rooms of calibrate world alone: leave it out")
    capture = binned(whole, usual_binning(whole) if binning is None else binning)
    if renderer is None:
        traced = "auto", samples_per_pixel, max_bounces, seed
        renderer, engines = CaptureRenderer(), engines or engines_of(*traced)
        rendering = rendering or (lambda capture: engine_changes(capture, *traced))
    kept = cache or LayerCache()
    phases = progress if isinstance(progress, Phases) else Phases(progress, PHASES)
    phases.begin(RENDERING)
    searched = BaseRenders(renderer, samples_per_pixel or usual_samples(capture), max_bounces, seed, kept)
    samples_per_pixel = samples_per_pixel or usual_samples(whole)
    known = _effects_of(model, capture.scene_path)
    made_by = renderer.version, searched.samples_per_pixel, max_bounces

    def render(
        capture: Capture, split: str = "train", progress: Progress | None = phases, is_draft: bool = False
    ) -> LayersOfFrames:
        return searched.for_fits(capture, capture.split(split), progress, is_draft)

    looked: list[tuple[Geometry, FitCache]] = []

    def look(evidence: Evidence) -> None:
        looked.append((evidence.geometry, memory := FitCache(kept, evidence.train, workers)))
        tell(first_words(evidence, known, _within_reach(evidence, candidates)[0], numbers, memory))

    def located(
        model: Model, near: Evidence | None = None, at_most: float = np.inf,
        seen: Callable[[Evidence], object] = lambda evidence: None,
    ) -> tuple[Evidence, Rendering | None]:  # fmt: skip
        how = near, partial(render, is_draft=True), seen, workers, at_most
        evidence = gather_where_it_stands(capture, render, model, seed, kept, made_by, *how)
        return evidence, None if rendering is None else rendering(evidence.capture)

    def with_test(evidence: Evidence, fitter: Fitter, solution: Solution, model: Model) -> Evidence:
        return with_test_frames(evidence, fitter, solution, model, partial(render, split="test", progress=None))

    errors = ErrorsOfModels(whole, replace(searched, samples_per_pixel=samples_per_pixel), engines, phases)
    made = RenderedWith(renderer.version, samples_per_pixel, max_bounces, seed)
    options = made, searched.samples_per_pixel, capture.binning, numbers, rendering is None, engines is None
    is_given = isinstance(model, SensorModel) or bool(known.effects)
    key = None if is_given else key_of(whole, effects, *options)
    tell = says or (lambda text: None)
    known_before = None if key is None else found_before(kept, key, whole)
    if known_before is not None:  # its images are made from kept renders
        result, complete, stub = known_before
        tell(_verdict_words(result["verdict"], result["added"], False))
        phases.begin(BOTH)
        _, seen = held_out_figures(errors.at_stated_geometry(complete), None, result["added"], complete)
        accepted = complete.bound(surface_names(whole.scene_path))
        return Diagnosis(result, accepted, stub, complete, *without_light(seen.before, seen.after), made, key)

    evidence, engine = located(known) if says is None else located(known, seen=look)
    memory = next((found for at, found in looked if evidence.geometry.is_same(at)), None)
    memory = memory or FitCache(kept, evidence.train, workers)
    settings = Settings(phases, numbers, engine, memory, errors, located, with_test, tell)
    try:
        diagnosis = examine(evidence, model, candidates, settings)
    except np.linalg.LinAlgError as error:  # a ValueError, which would blame the input
        raise RuntimeError(f"{capture_path}: the search failed: {error}; its renders and fits are kept") from error
    finally:
        memory.save()  # keeps finished fits when a run is cancelled
    if key is not None and diagnosis.sensor_model is not None:
        keep(kept, key, (diagnosis.result, diagnosis.sensor_model, diagnosis.stub))
    return replace(diagnosis, made=made, kept_as=key)


def _undetermined(reason: str, model: Model) -> Diagnosis:
    text = "record the infrared images of both cameras, with two or more frames of each static view"
    result: dict[str, Any] = NOTHING_TOLD | {
        "verdict": UNDETERMINED,
        "reason": reason,
        "probabilities": None,
        "ranking": [],
        "sets": [],
        "added": [],
        "next_measurement": [{"text": text, "separates": [], "change": None}],
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
    """Diagnoses evidence that is already gathered, and returns the Diagnosis. given: the model to start from.
    candidates: effects to choose from."""
    settings = settings or Settings()
    phases, numbers = settings.phases or Phases(None, PHASES), settings.numbers
    model = _effects_of(given, evidence.capture.scene_path)
    if all(np.ptp(o.measured) == 0 for o in evidence.train):
        return _undetermined("the infrared images are blank", model)
    phases.begin(FITTING)
    outcome = Search(evidence, model, _within_reach(evidence, candidates)[0], settings).run()
    outcome.evidence.forget()
    outcome.fitter.forget()
    told = partial(_told, given=given, candidates=candidates)
    with_names = replace(outcome.rest, test_left=None if settings.errors is None else 0.0)  # test frames decide below
    found, (explained, left, unlike) = told(replace(outcome, rest=with_names), settings=settings)
    tested = replace(outcome.rest, test_explained=explained, test_left=left, test_unlike=unlike)
    confirmed = replace(outcome, rest=tested)
    if _verdict(confirmed, numbers) != found.result["verdict"]:
        return told(confirmed, settings=replace(settings, phases=Phases(None, PHASES)))[0]
    return replace(found, result=found.result | _verdict_evidence(confirmed, numbers))


def _verdict_evidence(outcome: Outcome, numbers: Numbers) -> dict[str, Any]:
    """Returns the entries of diagnose.json that justify the verdict: probabilities, ranking, and the numbers compared
    with thresholds."""
    verdict, name_of = _verdict(outcome, numbers), surface_text(outcome.evidence.capture.scene_path)
    return {
        "probabilities": None if verdict == UNDETERMINED else probabilities_of(outcome, numbers),
        "ranking": ranking_of(outcome, numbers, verdict == EFFECT, name_of),
        "judging": judging_of(outcome),
    }


def _verdict(outcome: Outcome, numbers: Numbers) -> str:
    return verdict_of(outcome.rest, bool(outcome.names), outcome.evidence.has_floor, numbers)


_Tested = tuple[float | None, float | None, float]
_UNTESTED: _Tested = (None, None, 0.0)


def _test_errors(
    outcome: Outcome, test: Sequence[Observation], standing: ImageErrors, after: ImageErrors, numbers: Numbers
) -> _Tested:
    """Returns (explained, left, unlike) of the test frames, as Remainder defines them. standing, after: errors without
    and with the named effects.

    If an effect is named, pixels have the weights of fits, so misplaced edges count less. If none is named, all pixels
    of an image weigh alike, because a missing effect may change edges only. explained and left are None without test
    frames, or if temporal noise is named, which the weights lack. No model predicts random fields. If one is named,
    test frames count only if other effects explain something, and by their error beyond that of train frames
    (draws_growth()).
    """
    if not test or any(n.id in outcome.noise for n in outcome.names):
        return _UNTESTED
    if not outcome.names:
        noise = outcome.evidence.noise_model
        test = [replace(o, weight=np.full(o.weight.shape, 1.0 / noise.image_variance(o))) for o in test]
    square = _mean_square(test, after)
    explained, left, unlike = _mean_square(test, standing) - square, square - 1.0, 0.0
    if draws := [n.effect for n in outcome.names if n.field is not None]:
        if outcome.rest.explained - outcome.rest.drawn < numbers.least_excess:
            return _UNTESTED
        growth = max(draws_growth(effect, after, outcome.solution.nuisances.black_dn) for effect in draws)
        left -= growth * (_mean_square(outcome.evidence.train, after) - 1.0)
        if left <= explained:
            return _UNTESTED
    elif outcome.names:
        frames = [[o for o in test if o.frame.id == f] for f in sorted({o.frame.id for o in test})]
        errors = [(_mean_square(frame, standing), _mean_square(frame, after)) for frame in frames]
        unlike = max((with_ - 1.0) / max(without - with_, numbers.scene_error) for without, with_ in errors)
    return explained, left, unlike


def _mean_square(observations: Sequence[Observation], errors: ImageErrors) -> float:
    """Returns the mean squared error of images without the renderer's noise, in noise variances (1 /
    Observation.weight)."""
    squares = (o.weight * errors.squares_of_blocks(o.key, o.view.binning) for o in observations)
    total = sum(square.ravel()[o.picked()].sum() for square, o in zip(squares, observations, strict=True))
    return float(total / sum(o.pixels for o in observations))


def _told(
    outcome: Outcome, given: Model | SensorModel | None, candidates: Sequence[Effect], settings: Settings
) -> tuple[Diagnosis, _Tested]:
    """Returns (the Diagnosis for the outcome of a search, the result of _test_errors())."""
    phases, numbers = settings.phases or Phases(None, PHASES), settings.numbers
    evidence, names, name_of = outcome.evidence, outcome.names, surface_text(outcome.evidence.capture.scene_path)
    model = _effects_of(given, evidence.capture.scene_path)
    verdict = _verdict(outcome, numbers)
    is_found = verdict == EFFECT
    waits = outcome.rest.test_explained is None and bool(evidence.capture.split("test"))
    settings.says(_verdict_words(verdict, [name.id for name in names] if is_found else [], waits))
    solution = outcome.solution if is_found else outcome.first
    rows = outcome.rows
    if names and not is_found:
        rows = tuple(Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles).residuals(solution))
    found = {name.id: parameters_of(outcome, name) for name in names}
    accepted = restore_functions(solution.model, candidates)
    for name in names if is_found else ():
        if not name.in_model:
            accepted = accepted.with_effect(name.effect, **{key: v.value for key, v in found[name.id].items()})
    phases.begin(BOTH)
    if settings.with_test is not None:
        own = restore_functions(solution.model, candidates)
        evidence = settings.with_test(evidence, outcome.fitter, solution, own)
    capture, black_dn, added = evidence.capture, solution.nuisances.black_dn, [n.id for n in names if is_found]
    complete, depth, judged = found_model(evidence, accepted, solution, found), Depth((), False), dict(NOTHING_TOLD)
    before = after = None
    tested = _UNTESTED
    if settings.errors is not None:
        errors = settings.errors.at_stated_geometry(complete)
        figures, images = held_out_figures(errors, given, added, complete)
        before, after = images.before, images.after
        tested = _test_errors(outcome, evidence.test, images.standing, after, numbers)
        phases.begin(DEPTH)
        judge = evidence.seed, numbers, settings.memory
        depth = judged_depth(errors.capture, after, accepted, excess_of(rows), candidates, *judge)
        for fault in depth.named(is_choice=False)[:1]:
            found[fault.effect.id] = fault.parameters()
            accepted = accepted.with_effect(fault.effect, **{key: v.value for key, v in found[fault.effect.id].items()})
            complete = found_model(evidence, accepted, solution, found)
            after = replace(after, model=complete.bound(surface_names(capture.scene_path)))
        split = depth_split(errors.capture, images.plain, images.standing, after, depth, name_of, evidence.seed)
        judged |= {name: value for name, value in figures.items() if value is not None} | {"depth_split": split}
    if judged["heldout_ir_rmse_before"] is None:  # there are no errors of test frames
        first, last = (left_out_rmse(outcome.fitter, fit) for fit in (outcome.first, solution))
        judged |= {f"heldout_ir_rmse_{which}": first for which in ("before", "geometry")}
        judged |= {"heldout_ir_rmse_after": last}
    if judged["heldout_noise_floor"] is None and evidence.has_floor:
        judged |= {"heldout_noise_floor": float(np.sqrt(evidence.floor_variance(evidence.train)))}
    chosen, out_of_reach = _within_reach(evidence, candidates)
    unjudged = [*out_of_reach, *((e, outcome.unjudged[e.id]) for e in chosen if e.id in outcome.unjudged)]
    residual = residual_model(rows, black_dn, evidence.seed) if verdict == UNKNOWN else None
    result: dict[str, Any] = judged | {
        "verdict": verdict,
        "capture": capture.name,
        "binning": capture.binning,
        "alpha": numbers.alpha,
        "least_share": numbers.least_share,
        "sets": sets_of(outcome),
        "not_ranked": [{"effect": e.id, "family": e.family, "reason": why} for e, why in unjudged],
        "added": added,
        "depth": depth_json(depth, numbers, name_of),
        "next_measurement": next_measurements(evidence, *_open_set(outcome)),
        "geometry": geometry_json(replace(standing(evidence, solution), deviations=evidence.geometry.deviations)),
        "albedos": albedo_json(evidence, outcome.fitter, solution),
        "residual_model": residual,
        "model": model_json(accepted, solution.nuisances),
    } | _verdict_evidence(outcome, numbers)  # fmt: skip
    result["own"] = {e.id: _why(e, result, model) for e in candidates if builtin().get(e.id) is not e}
    stub = None if residual is None else effect_stub(residual, capture.name)
    return Diagnosis(result, accepted, stub, complete, *without_light(before, after)), tested


def _verdict_words(verdict: str, added: Sequence[str], waits: bool) -> str:
    named = f" ({', '.join(added)})" if added else ""
    return f"verdict: {verdict}{named}{'; test frames have to confirm it' * waits}"


def _effects_of(given: Model | SensorModel | None, scene_path: Path | None) -> Model:
    return given.bound(surface_names(scene_path)) if isinstance(given, SensorModel) else given or Model()


def _within_reach(evidence: Evidence, candidates: Sequence[Effect]) -> tuple[list[Effect], list[tuple[Effect, str]]]:
    """Splits candidates into the effects that this evidence can judge and the others, each with the reason why not."""
    room = "it is of single surfaces, and the room was measured as its views' pictures"
    in_room = has_room_light(evidence.capture.scene_path)
    chosen, others = [], []
    for e in candidates:
        if e.channel is None:
            others.append((e, e.unjudged_reason))
        elif in_room and SURFACES in e.parameters:
            others.append((e, room))
        else:
            chosen.append(e)
    return chosen, others


def _open_set(outcome: Outcome) -> tuple[dict[str, Solution | None], float]:
    """Returns ({effect: its fit or None} of the first named set with more than one member, the residuals' design
    effect)."""
    name = next((name for name in outcome.names if name.seen is not None and len(name.members) > 1), None)
    design = design_effect(outcome.solution.sums.tile_chi2, outcome.fitter.tile_pixels())
    if name is None or name.seen is None:
        return {}, design
    fits = name.seen.fits
    return {id: fits[id].solution if id in fits else None for id in name.members}, design


def _why(effect: Effect, result: dict[str, Any], given: Model) -> str:
    """Returns a clause on why a user's own effect was named, skipped or not named."""
    if effect.id in {e.id for e, _ in given.effects}:
        return "it is part of the model that the diagnosis started from"
    skipped = {entry["effect"]: entry["reason"] for entry in result["not_ranked"]}
    if effect.id in skipped:
        return skipped[effect.id]
    if effect.id in (*result["added"], *result["depth"]["added"]):
        return "it explains the data best"
    entries = (*result["ranking"], *result["depth"]["ranking"])
    share = next((entry["explained_share"] for entry in entries if entry["effect"] == effect.id), None)
    if share is None:
        return "it explains next to nothing of the images"
    return f"it may not be named: it explains {100 * share:.1f} % of the error beside what is likelier"
