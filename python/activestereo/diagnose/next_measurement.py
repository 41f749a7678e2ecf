# SPDX-License-Identifier: Apache-2.0
"""The next measurement: exposures of the known views that would separate explanations that fit alike.

Its value is the expected difference of log-likelihood, 1/2 |mu_i - mu_j|^2 / variance, between two explanations after
one is refitted to the other's predictions for the new frames, while the recorded frames constrain its parameters and
nuisances (T-optimal design: Atkinson and Fedorov 1975), divided by the residuals' design effect. A measurement is
judged by its worst pair.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.diagnose.evidence import Evidence, Observation
from activestereo.diagnose.findings import Finding, Ranking
from activestereo.diagnose.propose.scan import scan_observations
from activestereo.diagnose.refine import Fitter, Solution
from activestereo.diagnose.refine.fitter import signal
from activestereo.diagnose.verdict.confidence import equivalents
from activestereo.effects.core.view import REFERENCE_TEMPERATURE_C

_MEMBERS = 3
_SUGGESTIONS = 3

Change = dict[str, Any]
Advice = dict[str, object]

# What changes in frames of the known views: factors, values, kelvins more or less, a velocity [v, w], repeats more.
_MENU: dict[str, Change] = {
    "the same views with the projector off": {"power_factor": 0.0},
    "the same views at a quarter of the exposure": {"exposure_factor": 0.25},
    "the same views at twice the exposure": {"exposure_factor": 2.0},
    "the same views at half the projector power": {"power_factor": 0.5},
    "the same views 20 K warmer": {"warming_k": 20.0},
    "the same views 20 K warmer with the projector off": {"warming_k": 20.0, "power_factor": 0.0},
    # Effects that agree at a higher temperature differ at a lower one: a laser brightens, a filter passes less either
    # way.
    "the same views 10 K cooler": {"warming_k": -10.0},
    "the same views with the rig moving sideways at 0.5 m/s": {"velocity": [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]},
    "the same views with the rig turning about its vertical axis at 1 rad/s": {
        "velocity": [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    },
    "two more repeats of each view": {"repeats": 2},
}
# The advice where no exposure of the known views helps: other views cannot be predicted without rendering them.
_OTHER_VIEWS = "six other views: another distance (at least twice as far) and other materials", {"views": 6}


def _changed(
    frame: Frame,
    power_factor: float = 1.0,
    exposure_factor: float = 1.0,
    warming_k: float = 0.0,
    velocity: list[float] | None = None,
    repeats: int = 0,
) -> Frame:
    """A frame of a known view under other settings."""
    temperature_c = frame.temperature_c
    if warming_k:
        temperature_c = (REFERENCE_TEMPERATURE_C if temperature_c is None else temperature_c) + warming_k
    return replace(
        frame,
        projector_power=power_factor * frame.projector_power,
        exposure_s=exposure_factor * frame.exposure_s,
        temperature_c=temperature_c,
        camera_velocity=frame.camera_velocity if velocity is None else np.array(velocity),
    )


def next_measurements(ranking: Ranking, evidence: Evidence) -> list[Advice]:
    """[{text, nats, separates, change}] best first; empty where nothing is open.

    change: of the menu's frames, views: so many more poses; None for other advice.
    """
    if not evidence.has_floor:
        text = "repeat every static view at least twice: without repeats the noise floor is unknown"
        return [{"text": text, "nats": None, "separates": [], "change": None}]
    members = _open_set(ranking)
    if len(members) < 2:
        return []
    observations = scan_observations(evidence.train, evidence.seed)
    # Images of random fields cannot be predicted, but they differ from other poses: gains stay on the pixels, grains do
    # not.
    predicted = [f for f in members if f.solution is not None]
    scored = []
    for text, change in _MENU.items() if len(predicted) > 1 else ():
        nats, pair = _worst_pair(ranking, evidence, predicted, observations, change)
        scored.append((nats, text, pair))
    scored.sort(key=lambda entry: -entry[0])
    useful = [entry for entry in scored if entry[0] > ranking.thresholds.worth_nats]
    advice: list[Advice] = [
        {"text": f"{text} (expected {nats:.0f} nats)", "nats": nats, "separates": list(pair), "change": _MENU[text]}
        for nats, text, pair in useful
    ]
    # A measurement that brings little more than the same frames again is not worth it: errors of the scene measurement,
    # which more light does not reduce, hide the difference in these views.
    again = _worst_pair(ranking, evidence, predicted, observations, {})[0] if useful else np.inf
    if not useful or useful[0][0] < ranking.thresholds.lever_ratio * again:
        text, change = _OTHER_VIEWS
        advice = [{"text": text, "nats": None, "separates": [f.id for f in members], "change": change}, *advice]
    return advice[:_SUGGESTIONS]


def separating_view(ranking: Ranking, evidence: Evidence) -> Advice | None:
    """{text, frame, nats}: the known view of which another frame tells most between a ranking's findings, all of which
    explain the images alike. None where no view tells enough, or the noise is not known."""
    members = [f for f in ranking.findings if f.solution is not None][:_MEMBERS]
    if len(members) < 2 or not evidence.has_floor:
        return None
    views: dict[bytes, Observation] = {}
    for o in scan_observations(evidence.train, evidence.seed):
        views.setdefault(o.frame.camera_to_world.tobytes(), o)
    told = {}
    for o in views.values():
        one = replace(ranking, pixels=2 * o.view.depth_m.size)  # both cameras of one frame
        told[o.frame.id] = _worst_pair(one, evidence, members, [o], {})[0]
    frame = max(told, key=lambda key: told[key])
    if told[frame] <= ranking.thresholds.worth_nats:
        return None
    text = f"the view of frame {frame} separates them best (expected {told[frame]:.0f} nats by each further frame)"
    return {"text": text, "frame": frame, "nats": told[frame]}


def _open_set(ranking: Ranking) -> list[Finding]:
    """The first finding and those that cannot be told from it."""
    best = ranking.best
    if best is None or best.score.nats <= 0 or not best.on_images:
        return []
    names = {best.id, *equivalents(ranking, best)}
    return [f for f in ranking.findings if f.id in names][:_MEMBERS]


def _worst_pair(
    ranking: Ranking,
    evidence: Evidence,
    members: Sequence[Finding],
    observations: Sequence[Observation],
    change: Change,
) -> tuple[float, tuple[str, ...]]:
    frames = [_changed(o.frame, **change) for o in observations]
    changed = [replace(o, frame=f, view=replace(o.view, frame=f)) for o, f in zip(observations, frames, strict=True)]
    # As many pixels as the train frames have: each view is recorded again.
    copies = ranking.pixels / sum(o.pixels for o in observations)
    worst: tuple[float, tuple[str, ...]] = (np.inf, ())
    for first, second in combinations(members, 2):
        nats = left_between(evidence, changed, first.fitted, second.fitted, copies) / ranking.design_effect
        worst = min(worst, (float(nats), (first.id, second.id)))
    return worst


def left_between(
    evidence: Evidence, changed: Sequence[Observation], truth: Solution, rival: Solution, copies: float
) -> float:
    """Half the squared distance, in deviations, between the prediction of `truth` and the nearest prediction of
    `rival`, by one Gauss-Newton step that is penalised by what it worsens the recorded frames.
    """
    predicted = []
    for o in changed:
        image = signal(truth.model, o, truth.model.light(o.layers, o.view, supersampled=False), truth.phi)
        weight = 1.0 / np.maximum(evidence.noise_model.variance(image, o.frame.gain), ROUNDING_VARIANCE)
        predicted.append(replace(o, measured=image, weight=weight))
    fitter = Fitter(predicted, evidence.nuisance_prior(), evidence.tiles, supersampled=False)
    space, theta, phi = rival.space, rival.theta, rival.phi
    new = fitter.linearise(space, theta, phi, fitter.lights(space, theta))
    known = rival.sums.gram.sum(0) + np.diag(fitter.prior(len(theta), space))
    gram, moment = copies * new.gram.sum(0) + known, copies * new.moment.sum(0)
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-30))
    step = np.linalg.lstsq(gram / np.outer(norm, norm), moment / norm, rcond=1e-10)[0]
    return 0.5 * max(copies * new.total - step @ (moment / norm), 0.0)
