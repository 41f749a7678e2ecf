# SPDX-License-Identifier: Apache-2.0
"""Diagnoses a room that `calibrate world` measured. Nothing is rendered, because the scene is unknown, too."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Any

import cv2
import numpy as np

from activestereo.calibrate.world.cells import Room
from activestereo.calibrate.world.light import LightView, black_level, solve_light
from activestereo.calibrate.world.views import Image, SceneView, blurred, points_of
from activestereo.capture.capture import Capture
from activestereo.diagnose.figures import NOTHING_TOLD
from activestereo.diagnose.goodness import Z90
from activestereo.diagnose.room.bands import LEAST_GEOMETRY
from activestereo.diagnose.room.beside import falloff, falloff_of
from activestereo.diagnose.room.columns import BEND, is_alike_in_views, size_of
from activestereo.diagnose.room.evidence import NEEDED, Found
from activestereo.diagnose.room.names import Names, Seen, names_of
from activestereo.diagnose.room.plan import plan_of, sizes
from activestereo.diagnose.room.unseen import Unseen, predict_unseen
from activestereo.diagnose.verdict import EFFECT, NONE, UNDETERMINED
from activestereo.effects import Effect, Model, builtin
from activestereo.effects.engines.loaded_scene import is_measured_room
from activestereo.model import SensorModel, diagnosed_model
from activestereo.model.library import model_json

_FALLOFF = "vignetting"
_MAINS_HZ = 100.0
_DISAGREE = "the views disagree by more than the likeliest effect can explain; measure the room again from more views"
_NOT_RANKED = "a room measured by the same camera has it in its dots or surfaces, or good sessions tell no spread of it"

# Sessions of one D415 agree in focal length and centre to 0.5 deviations. Their dots correlate 0.53 to 0.81; unrelated
# patterns, at the best of all shifts, 0.28 to 0.38.
_APART_SD, _BEYOND_CHANCE = 8.0, 0.1
_PATCH_PX, _REACH_PX, _LEAST_LIT = 128, 16, 2.0
_WHOLE_PX = 4.0  # blur of the light whose ratios tell the falloff, at half size


def diagnosed_room(
    capture: Capture, given: Model, effects: Mapping[str, Effect], reference: Sequence[Capture] = ()
) -> tuple[dict[str, Any], Model, SensorModel, tuple[Unseen, Unseen] | None]:
    """Diagnoses a measured room. Returns (diagnose.json's contents, the model with the effects found, model.json's
    contents, Diagnosis.unseen). reference: sessions of the same unit from when it was good. Raises ValueError if a
    reference is no measured room, or has another image size or is of another unit."""
    room = Room(capture)
    names = names_of(room, given, effects, [_room_of(other, capture) for other in reference])
    told = [in_own_units(f, names.seen) for f in names.named]
    possible = list(takewhile(lambda f: not _beyond(f), told))
    found = [*_falloff(names.seen, names.named[: len(possible)]), *possible]
    accepted, intervals = given, {}
    for f in found:
        values = {p.name: float(np.clip(f.parameters[p.name][0], p.low, p.high)) for p in f.effect.parameters
                  if p.name in f.parameters}  # fmt: skip
        accepted = accepted.with_effect(f.effect, **values)
        for name, (value, deviation) in f.parameters.items():
            intervals[f.effect.id, name] = (value - Z90 * deviation, value + Z90 * deviation)
    added = [f.effect.id for f in found]
    rest = [in_own_units(f, names.seen) for f in names.ranking if f.effect.id not in {n.effect.id for n in names.named}]
    others = [replace(f, nats=max(f.nats, 0.0), finding="") for f in rest]
    ranking = [*found, *told[len(possible) :], *others]
    ranked = {*(f.effect.id for f in ranking), *(e.id for e, _ in given.effects), _FALLOFF}
    by_view = _unseen(names.seen, given, accepted)
    shown = max(by_view, key=lambda pair: pair[0].rmse_dn ** 2 - pair[1].rmse_dn ** 2, default=None)
    result: dict[str, Any] = NOTHING_TOLD | {
        "verdict": UNDETERMINED if len(possible) < len(told) else EFFECT if added else NONE,
        "capture": capture.name,
        "binning": 1,
        "probabilities": _probabilities(names, added),
        "ranking": [_entry(f) for f in ranking],
        "sets": [{"effects": list(f.members), "probabilities": list(f.members.values())} for f in possible],
        "own": {name: _NOT_RANKED for name, e in effects.items() if builtin().get(name) is not e},
        "not_ranked": [
            {"effect": name, "family": e.family, "reason": _NOT_RANKED}
            for name, e in effects.items() if name not in ranked
        ],
        "added": added,
        "depth": {"verdict": "undetermined", "reason": "a measured room is judged by its images", "ranking": [],
                  "added": []},
        "heldout_ir_rmse_before": _rms(before for before, _ in by_view),
        "heldout_ir_rmse_geometry": _rms(before for before, _ in by_view),
        "heldout_ir_rmse_after": _rms(after for _, after in by_view),
        "predicted_by_views": not capture.split("test"),
        "not_predicted": [f.effect.id for f in found if not is_alike_in_views(f.effect)],
        "next_measurement": _next(names),
        "model": model_json(accepted),
    }  # fmt: skip
    if len(possible) < len(told):
        result["reason"] = f"{_DISAGREE} ({_beyond(told[len(possible)])})"
    return result, accepted, diagnosed_model(capture, accepted, intervals=intervals), shown


def _room_of(reference: Capture, capture: Capture) -> Room:
    """Returns the Room of a reference. Raises ValueError if it does not fit the capture."""
    if not is_measured_room(reference):
        raise ValueError(f"{reference.path}: is no reference: make it with calibrate world from two or more views")
    sizes = [f"{c.rig.left.width}x{c.rig.left.height}" for c in (reference, capture)]
    if sizes[0] != sizes[1]:
        raise ValueError(f"{reference.path}: is {sizes[0]}, the capture {sizes[1]}: give a session of the same unit")
    if why := _other_unit(reference, capture):
        raise ValueError(f"{reference.path}: is of another unit than {capture.path}: {why}: give a session of the same")
    return Room(reference)


def _other_unit(reference: Capture, capture: Capture) -> str:
    """Returns the reason why two measured rooms cannot be of one camera; an empty text if they can."""
    cameras = [c.measured.get("camera", {}) for c in (reference, capture)]
    told = [(np.array(c["f_cx_cy_px"]), np.array(c["covariance_px2"])) for c in cameras if c.get("covariance_px2")]
    if len(told) == 2:
        (first, one), (second, other) = told
        apart = np.abs(first - second) / np.sqrt(np.diag(one + other))
        if apart.max() > _APART_SD:
            worst = int(apart.argmax())
            name = ("focal length", "centre's column", "centre's row")[worst]
            return f"its {name} is {first[worst]:.1f} px, not {second[worst]:.1f} px"
    dots = [c.measured.get("pattern", {}) for c in (reference, capture)]
    if all(d.get("is_common", False) for d in dots):
        first, second = (np.asarray(255.0 * c.rig.projector.pattern(), np.float32) for c in (reference, capture))
        r, chance = _shared_dots(first, second), _shared_dots(first, np.ascontiguousarray(second[::-1, ::-1]))
        if r < chance + _BEYOND_CHANCE:
            return f"its dots correlate {r:.2f} with the capture's, as chance does ({chance:.2f})"
    return ""


def _shared_dots(first: Image, second: Image) -> float:
    """Returns the median correlation of two patterns' patches, each at its best shift. A shift is allowed because the
    projector's pose is known only to a few pixels."""
    first, second = (image - blurred(image, _PATCH_PX / 16) for image in (first, second))
    found, side, reach = [], _PATCH_PX, _REACH_PX
    for row in range(reach, first.shape[0] - side - reach, 2 * side):
        for column in range(reach, first.shape[1] - side - reach, 2 * side):
            patch = first[row : row + side, column : column + side]
            around = second[row - reach : row + side + reach, column - reach : column + side + reach]
            if min(patch.std(), around.std()) > _LEAST_LIT:
                found.append(float(cv2.matchTemplate(around, patch, cv2.TM_CCOEFF_NORMED).max()))
    return float(np.median(found)) if found else 1.0


def _falloff(seen: Seen, found: Sequence[Found]) -> list[Found]:
    """Returns the finding of lens falloff as overlapping views show it; [] if the given model has it or it is not
    significant. Changes by the effects found are removed first, since a ghost, for example, passes for falloff. They
    are known to first order only, so the exponent's standard error includes the shift of the exponent by them."""
    told = falloff(seen.room, seen.asked)
    if told is None:
        return []
    shares = {name: value for f in found for name, (value, _) in f.parameters.items()}
    less = {k: np.zeros(seen.room.shape, np.float32) for k in range(0, 2 * seen.room.judged, 2)}
    for column in (c for c in seen.scores.columns if c.name in shares):
        for k in less.keys() & set(column.images):
            less[k] += np.float32(shares[column.name] / column.step) * column.change(k, seen.light.both[k])
    exponent, deviation = told.parameters["exponent"]
    if any(image.any() for image in less.values()):
        before, after = (_exponent(seen, {k: share * image for k, image in less.items()}) for share in (0, 1))
        moved = after[0] - before[0]
        exponent, deviation = exponent + moved, float(np.hypot(max(deviation, after[1]), moved))
    beside = falloff_of(told.effect, exponent, deviation)
    return [replace(beside, members={_FALLOFF: 1.0})] if beside.nats > NEEDED else []


def _exponent(seen: Seen, less: Mapping[int, Image]) -> tuple[float, float]:
    """Returns (falloff exponent, its standard error) fitted to left images of a room, as `calibrate world` does. less:
    {image index: DN [height][width] to subtract}."""
    room, views = seen.room, []
    for k, taken in less.items():
        image, right = room.images[k : k + 2]
        surface = image.usable.astype(np.float32)
        whole, dots = (
            blurred(light * surface, _WHOLE_PX) / np.maximum(blurred(surface, _WHOLE_PX), 1e-3)
            for light in (image.dn - taken, seen.light.dots[k])
        )
        view = SceneView(image.frame, image.whole, right.whole, image.depth_m, image.usable)
        own = view, points_of(image.depth_m, image.K), whole, dots, whole, dots, image.geometry, image.r2()
        views.append(LightView(*own, image.usable & (image.geometry > LEAST_GEOMETRY)))
    poses = [room.pose(room.images[k]) for k in less]
    fitted = solve_light(views, poses, room.images[0].K, black_level([v.view for v in views])).exponent
    return fitted or (0.0, np.inf)


def in_own_units(found: Found, seen: Seen) -> Found:
    """Returns a found effect with its parameters' values and standard errors by parameter name, in the parameters'
    units. Flicker gets its depth, and the line time that it has if the light flickers at 100 Hz."""
    columns = {c.name: c for c in seen.scores.columns if c.effect is found.effect}
    out = {}
    if found.effect.id == "flicker_banding":
        (period_rows,) = seen.chosen[found.effect.id]
        values, deviations = np.array(list(found.parameters.values())).T
        depth = float(np.mean(np.hypot(values[::2], values[1::2])))
        out = {"depth": (depth, float(np.mean(deviations))), "line_time_s": (1.0 / (_MAINS_HZ * period_rows), 0.0)}
    elif found.effect.id == "black_level":
        out = {"offset_dn": max(found.parameters.values(), key=lambda told: abs(told[0]))}
    else:
        for name, (value, deviation) in found.parameters.items():
            if name.endswith(BEND):
                continue  # the effect has no parameter for it
            slope = 1.0
            if name in columns and not found.finding:
                value, slope = size_of(seen.room, seen.light, columns[name], np.sign(value))(value)
            out[name.split(".")[1]] = (value, slope * deviation)
    return replace(found, parameters=out)


def _beyond(found: Found) -> str:
    """Returns a clause on a parameter that lies outside its range by more than its error; empty if none does."""
    for p in found.effect.parameters:
        value, deviation = found.parameters.get(p.name, (p.neutral, 0.0))
        if not p.low - Z90 * deviation <= value <= p.high + Z90 * deviation:
            return f"{found.effect.id} would need {p.name} {value:.3g}, where {p.low:g} to {p.high:g} is possible"
    return ""


def _entry(found: Found) -> dict[str, Any]:
    """Returns an effect's row of diagnose.json's ranking."""
    effect = found.effect
    shown = {
        p.name: {"value": value, "low": value - Z90 * sd, "high": value + Z90 * sd, "unit": p.unit}
        for p in effect.parameters
        for value, sd in [found.parameters.get(p.name, (p.neutral, 0.0))]
    }
    return {
        "effect": effect.id, "family": effect.family, "finding": found.finding or effect.finding,
        "channel": "noise" if effect.id == "row_noise" else "infrared", "score_nats": found.nats,
        "confidence": found.members.get(effect.id, 0.0), "explained_share": None, "gain_reduced_chi2": None,
        "parameters": shown, "equivalent": [name for name in found.members if name != effect.id],
    }  # fmt: skip


def _probabilities(names: Names, added: Sequence[str]) -> dict[str, Any]:
    """Returns `probabilities` of diagnose.json, from the evidence beyond the threshold for naming an effect."""
    odds = np.exp(max((min(f.nats, 500.0) - NEEDED for f in names.ranking), default=-np.inf))
    first = names.named[0].members if names.named else {}
    named = {name: float(odds / (1.0 + odds)) * p for name, p in first.items()}
    if not named and added:
        named = {added[0]: 1.0}
    return {"named": named, "none": max(1.0 - sum(named.values()), 0.0), "something_else": 0.0}


def _next(names: Names) -> list[dict[str, Any]]:
    """Returns `next_measurement` of diagnose.json: recordings that would detect effects that this one cannot. The last
    entry lists the effects that this recording detects."""
    this, *others = plan_of(names.seen)
    out = [{"text": f"{r.text} ({r.minutes:g} min)", "separates": list(r.tells), "change": None} for r in others]
    told = f"nothing more: this recording tells {sizes(this) or 'no effect'}"
    return [*out, {"text": told, "separates": [], "change": None}]


def _unseen(seen: Seen, given: Model, accepted: Model) -> list[tuple[Unseen, Unseen]]:
    """Returns each held-out view (every view, if none is held out) predicted from the other views, as a pair under both
    models. Only effects alike in all views are applied. Views that no other view sees are left out."""
    room = seen.room
    test = [f.id for f in room.capture.split("test") if f.depth_path is not None]
    whole = room if not test else Room(room.capture, [*(f.id for f in room.frames), *test])
    models = [[(e, values) for e, values in m.effects if is_alike_in_views(e)] for m in (given, accepted)]
    views, told = [n for n, f in enumerate(whole.frames) if not test or f.id in test], []
    for effects in models if models[0] != models[1] else models[:1]:
        exponent = next((values["exponent"] for e, values in effects if e.id == _FALLOFF), 0.0)
        others = [(e, values) for e, values in effects if e.id != _FALLOFF]
        told.append(predict_unseen(whole, views, seen.light.black_dn, exponent, others))
    return [pair for pair in zip(told[0], told[-1], strict=True) if np.isfinite(pair[0].rmse_dn)]


def _rms(views: Iterable[Unseen]) -> float | None:
    errors = [view.rmse_dn for view in views]
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None
