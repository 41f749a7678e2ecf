# SPDX-License-Identifier: Apache-2.0
"""Suggests the next measurement: settings of the known views that would separate explanations that fit alike.

The value of a measurement is the expected difference of log-likelihood between two explanations, 1/2 |mu_i - mu_j|^2 /
variance. One of them is first refitted to the other's predictions for the new frames, while the recorded frames
constrain its parameters and nuisances (T-optimal design: Atkinson and Fedorov 1975). The value is divided by the
residuals' design effect. A measurement is ranked by the pair of explanations that it separates least.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from activestereo.capture.capture import Frame
from activestereo.common.rounding import ROUNDING_VARIANCE
from activestereo.diagnose.evidence import Evidence, Observation, one_of_each_situation
from activestereo.diagnose.fitter import Fitter, Solution, signal
from activestereo.effects.core.view import REFERENCE_TEMPERATURE_C

_MEMBERS = 3
_SUGGESTIONS = 3
# A proposed measurement separates by at least so many nats, and by so many times the nats of the same frames
# repeated: twice the light alone doubles the nats.
_WORTH_NATS, _LEVER = 2.0, 2.0

Change = dict[str, Any]
Advice = dict[str, object]

# Text of a measurement: its changes to frames of the known views, as _changed() takes them.
_MENU: dict[str, Change] = {
    "the same views with the projector off": {"power_factor": 0.0},
    "the same views at a quarter of the exposure": {"exposure_factor": 0.25},
    "the same views at twice the exposure": {"exposure_factor": 2.0},
    "the same views at half the projector power": {"power_factor": 0.5},
    "the same views 20 K warmer": {"warming_k": 20.0},
    "the same views 20 K warmer with the projector off": {"warming_k": 20.0, "power_factor": 0.0},
    # Effects that agree when warmer differ when cooler: a laser then brightens, but a filter passes less either way.
    "the same views 10 K cooler": {"warming_k": -10.0},
    "the same views with the rig moving sideways at 0.5 m/s": {"velocity": [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]},
    "the same views with the rig turning about its vertical axis at 1 rad/s": {
        "velocity": [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    },
    "two more repeats of each view": {"repeats": 2},
}
# The advice where no setting of the known views helps: other views cannot be predicted without rendering them.
_OTHER_VIEWS = "six other views: another distance (at least twice as far) and other materials", {"views": 6}


def _changed(frame: Frame, change: Change) -> Frame:
    """Returns a frame of the same view under other settings: factors on power and exposure, kelvins added to the
    temperature, and a velocity [v, w] in m/s and rad/s."""
    temperature_c = frame.temperature_c
    if warming_k := change.get("warming_k"):
        temperature_c = (REFERENCE_TEMPERATURE_C if temperature_c is None else temperature_c) + warming_k
    return replace(
        frame,
        projector_power=change.get("power_factor", 1.0) * frame.projector_power,
        exposure_s=change.get("exposure_factor", 1.0) * frame.exposure_s,
        temperature_c=temperature_c,
        camera_velocity=np.array(change.get("velocity", frame.camera_velocity)),
    )


def next_measurements(evidence: Evidence, members: Mapping[str, Solution | None], design: float) -> list[Advice]:
    """Returns suggestions for the next measurement, [{text, nats, separates, change}], best first.

    nats: expected difference of log-likelihood for the pair of explanations `separates` that it tells apart least; None
    for advice that is not computed. Without a known noise floor the only suggestion is to repeat views. Otherwise the
    list is empty if fewer than two explanations compete. change: the settings to change, {"views": number of further
    poses}, or None for other advice.

    members: {effect: its fit} for the effects that the recording cannot tell apart, likeliest first. A fit is None for
    an effect of random draws, which cannot be predicted. design: the residuals' design effect.
    """
    if not evidence.has_floor:
        text = "repeat every static view at least twice: without repeats the noise floor is unknown"
        return [{"text": text, "nats": None, "separates": [], "change": None}]
    names = list(members)[:_MEMBERS]
    if len(names) < 2:
        return []
    observations = one_of_each_situation(evidence.train, evidence.seed)
    predicted = {name: fit for name in names if (fit := members[name]) is not None}

    def told(change: Change) -> tuple[float, tuple[str, ...]]:
        nats, pair = _worst_pair(evidence, predicted, observations, change)
        return nats / design, pair

    scored = [(*told(change), text) for text, change in _MENU.items() if len(predicted) > 1]
    useful = [entry for entry in sorted(scored, key=lambda entry: -entry[0]) if entry[0] > _WORTH_NATS]
    advice: list[Advice] = [
        {"text": f"{text} (expected {nats:.0f} nats)", "nats": nats, "separates": list(pair), "change": _MENU[text]}
        for nats, pair, text in useful
    ]
    # A measurement that separates little more than the same frames repeated is not worth it: errors of the scene
    # measurement hide the difference in these views, and more light does not reduce them. Other views also separate
    # random effects: gains stay on their pixels from pose to pose, speckle grains do not.
    if not useful or useful[0][0] < _LEVER * told({})[0]:
        text, change = _OTHER_VIEWS
        advice = [{"text": text, "nats": None, "separates": names, "change": change}, *advice]
    return advice[:_SUGGESTIONS]


def _worst_pair(
    evidence: Evidence, members: Mapping[str, Solution], observations: Sequence[Observation], change: Change
) -> tuple[float, tuple[str, ...]]:
    """Returns (the least nats by which changed frames separate two of the members, the ids of these two effects)."""
    frames = [_changed(o.frame, change) for o in observations]
    changed = [replace(o, frame=f, view=replace(o.view, frame=f)) for o, f in zip(observations, frames, strict=True)]
    # Each view is recorded again, so that there are as many pixels as in the train frames.
    copies = evidence.pixels / sum(o.pixels for o in observations)
    worst: tuple[float, tuple[str, ...]] = (np.inf, ())
    for (first, truth), (second, rival) in combinations(members.items(), 2):
        worst = min(worst, (float(left_between(evidence, changed, truth, rival, copies)), (first, second)))
    return worst


def left_between(
    evidence: Evidence, changed: Sequence[Observation], truth: Solution, rival: Solution, copies: float
) -> float:
    """Returns the least expected nats between `truth` and `rival` under new settings: half the squared distance of
    their predictions, in noise deviations. The rival first takes one Gauss-Newton step towards the truth's predictions,
    penalised by a worse fit to recorded frames. changed: observations under new settings. copies: how often each
    counts."""
    predicted = []
    for o in changed:
        image = signal(truth.model, o, truth.model.light(o.layers, o.view, supersampled=False), truth.phi)
        weight = 1.0 / np.maximum(evidence.noise_model.variance(image, o.frame.gain), ROUNDING_VARIANCE)
        predicted.append(replace(o, measured=image, weight=weight))
    fitter = Fitter(predicted, evidence.nuisance_prior(), evidence.tiles, supersampled=False)
    space, theta, phi = rival.space, rival.theta, rival.phi
    new = fitter.linearise(space, theta, phi, fitter.lights(space, theta))
    known = rival.sums.gram + np.diag(fitter.prior(len(theta), space))
    gram, moment = copies * new.gram + known, copies * new.moment
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-30))
    step = np.linalg.lstsq(gram / np.outer(norm, norm), moment / norm, rcond=1e-10)[0]
    return 0.5 * max(copies * new.total - step @ (moment / norm), 0.0)
