"""Which physical effect is missing? Ranks the library on a capture's train frames and says what the data allow to say.

Test frames are touched once, for the held-out figures of the models along the way; they decide nothing.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from activestereo.capture import read_capture
from activestereo.effects import Model
from activestereo.lab.diagnose_data import gather
from activestereo.lab.diagnose_law import residual_law
from activestereo.lab.diagnose_next import next_measurements
from activestereo.lab.diagnose_report import ranking_json
from activestereo.lab.diagnose_settle import settled
from activestereo.lab.diagnose_verdict import is_unexplained, passes
from activestereo.lab.greedy import Step, greedy
from activestereo.lab.model_file import library, model_json
from activestereo.lab.random_fields import shown_together
from activestereo.lab.ranking import Ranking
from activestereo.lab.render import WARP_SCALE, render_frames

_RENDER_SHARE = 0.4


@dataclass(frozen=True)
class Diagnosis:
    """result: what diagnose.json holds. model: the given model with what was added. stub: Python text of an effect, or None."""

    result: dict
    model: Model
    stub: str | None = None


def diagnose(
    capture_path, model=None, effects=None, steps="one", renderer=None, samples_per_pixel=32, max_bounces=8, seed=0,
    cache=None, workers=2, progress=None,
):  # fmt: skip
    """A Diagnosis of the capture folder.

    model: a Model to start from; effects: {id: Effect} to choose from, None for the built-in ones. steps: "one" adds the best
    effect at most, "greedy" goes on until nothing passes. progress: called as progress(fraction done).
    """
    model, effects = model or Model(), library() if effects is None else effects
    reason = no_infrared(capture_path)
    if reason:
        return Diagnosis(_undetermined(reason, model), model)
    capture = read_capture(capture_path)
    if renderer is None:
        from activestereo.lab.kuafu_renderer import KuafuRenderer

        renderer = KuafuRenderer()
    share = progress and (lambda f: progress(_RENDER_SHARE * f))
    layers = render_frames(capture, renderer, samples_per_pixel, max_bounces, seed, cache, share, WARP_SCALE)
    evidence = gather(capture, layers)
    share = progress and (lambda f: progress(_RENDER_SHARE + (1.0 - _RENDER_SHARE) * f))
    return examine(evidence, model, list(effects.values()), steps, workers, share)


def no_infrared(capture_path):
    """Why infrared images cannot be judged, or None. Depth alone cannot tell one effect from another: nearly all fit it."""
    folder = Path(capture_path)
    file = folder if folder.name == "capture.json" else folder / "capture.json"
    if not file.is_file():
        return None  # read_capture says what is wrong
    try:
        frames = json.loads(file.read_text(encoding="utf-8"))["frames"]
        missing = frames and all(frame.get("left") is None and frame.get("right") is None for frame in frames)
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    return "the capture has no infrared images: depth alone fits nearly every effect" if missing else None


def _undetermined(reason, model):
    advice = {"text": "record the infrared images of both cameras, with two or more frames of each static view", "separates": [], "change": None}
    return {
        "verdict": "undetermined", "reason": reason, "ranking": [], "added": [], "heldout_ir_rmse_before": None,
        "heldout_ir_rmse_after": None, "heldout_noise_floor": None, "next_measurement": [advice], "law": None, "curve": [],
        "model": model_json(model),
    }  # fmt: skip


def examine(evidence, model, candidates, steps="one", workers=2, progress=None):
    """diagnose() on gathered evidence."""
    images = [o.measured for o in evidence.train]
    if all(np.ptp(image) == 0 for image in images):
        return Diagnosis(_undetermined("the infrared images are blank", model), model)
    first = Ranking(evidence, model, candidates, workers, progress)
    best = first.entries[0] if first.entries else None
    way = [Step((), first)]
    named = best is not None and passes(first, best)
    if named and best.solution is not None:
        best = first.entries[0] = settled(first, best)
    if named and (steps == "greedy" or is_unexplained(first, best, first)):
        way = greedy(first, evidence, model, candidates, workers, progress)
    last = way[-1].ranking
    verdict = _verdict(first, best, named, last, evidence)
    law = residual_law(last, evidence) if verdict == "unknown" else None
    beside = []
    if verdict != "effect":
        way = way[:1]  # no name is claimed where most of the error stays
    elif steps == "one":
        way, beside = way[:1], [best]
    else:
        beside = _beside(last)
    added = way[-1].added + tuple(e.id for e in beside)
    final_model = _model_of(way[-1].ranking, beside)
    figures = _figures(evidence, first, way, beside)
    result = {
        "verdict": verdict,
        "capture": evidence.capture.name,
        "ranking": ranking_json(first),
        "added": list(added),
        **figures,
        "next_measurement": next_measurements(first, evidence),
        "law": law and law.as_json(),
        "model": model_json(final_model, last.base.solution.nuisances),
    }
    return Diagnosis(result, final_model, law and law.stub())


def _beside(ranking):
    """Entries that still pass at the end without an expected image to go on from: random fields that stay (the best, or those that are
    shown together), noise, and the best fault of the depth engine."""
    passing = [e for e in ranking.entries if e.solution is None and passes(ranking, e)]
    fields = [e for e in passing if e.static is not None]
    both = shown_together(fields, ranking) if len(fields) > 1 else []
    noise = [e for e in passing if e.channel == "noise"]
    return noise + (both if fields and fields[0].id in {e.id for e in both} else fields[:1]) + [e for e in passing if e.channel == "depth"][:1]


def _verdict(first, best, named, last, evidence):
    if not named:
        if not evidence.has_floor:
            return "undetermined"
        return "unknown" if is_unexplained(first, first.base) else "none"
    if best.channel != "infrared":
        left = replace(last.base, repeats=best.repeats)
        return "unknown" if is_unexplained(last, left) else "effect"  # its own channel tells it, where the images lack nothing else
    end = min([last.base, *[e for e in last.entries if passes(last, e)]], key=lambda e: e.chi2)
    return "unknown" if all(is_unexplained(last, e, first) for e in (best, end)) else "effect"


def _model_of(ranking, beside):
    """The ranking's base model, or that of the one fitted entry added to it, with what was added beside."""
    model = ranking.base.solution.model
    for entry in beside:
        if entry.solution is not None:
            model = entry.solution.model
        else:
            model = model.with_effect(entry.effect, **{name: v["value"] for name, v in entry.parameters.items()})
    return model


def _figures(evidence, first, way, beside):
    """Held-out figures, and error against effects added: pooled over test images, DN."""
    stages = [(step.added, step.ranking.base) for step in way]
    for entry in beside:
        shown = stages[-1][1] if entry.channel != "infrared" else entry
        stages.append(((*stages[-1][0], entry.id), shown))
    curve = []
    for names, entry in stages:
        train, test = (_rmse(first, entry, split, held) for split, held in ((evidence.train, False), (evidence.test, True)))
        curve.append({"effects": list(names), "train_ir_rmse": train, "heldout_ir_rmse": test})
    floor = {}
    for name, split in (("train", evidence.train), ("heldout", evidence.test)):
        floor[name] = float(np.sqrt(evidence.floor_variance(split))) if split and evidence.has_floor else None
    return {
        "heldout_ir_rmse_before": curve[0]["heldout_ir_rmse"],
        "heldout_ir_rmse_after": curve[-1]["heldout_ir_rmse"],
        "heldout_noise_floor": floor["heldout"],
        "train_noise_floor": floor["train"],
        "curve": curve,
    }


def _rmse(ranking, entry, observations, held):
    if not observations:
        return None
    if entry.static is not None:
        residuals = entry.static.test_residuals if held else entry.static.residuals
    else:
        residuals = [r for *_, r in ranking.rows(observations, entry.solution)]
    return float(np.sqrt(sum((r.astype(np.float64) ** 2).sum() for r in residuals) / sum(r.size for r in residuals)))
