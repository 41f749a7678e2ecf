"""What to measure next: of a menu of exposures of the known views, those that would separate explanations that fit alike.

Expected log-likelihood between two members, 1/2 |mu_i - mu_j|^2 / variance with scales and black level profiled out (T-optimal
design: Atkinson and Fedorov 1975), divided by the residuals' design effect; a measurement counts by its worst pair.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np

from activestereo.effects.core.view import REFERENCE_TEMPERATURE_C
from activestereo.lab.diagnose_fit import signal
from activestereo.lab.diagnose_scan import scan_observations
from activestereo.lab.diagnose_verdict import equivalents

_MEMBERS = 3
_SUGGESTIONS = 3
_WORTH_NATS = 2.0

# What changes in frames of the known views: factors, values, kelvins more, a velocity [v, w], repeats more.
_MENU = {
    "the same views with the projector off": {"power_factor": 0.0},
    "the same views at a quarter of the exposure": {"exposure_factor": 0.25},
    "the same views at twice the exposure": {"exposure_factor": 2.0},
    "the same views at half the projector power": {"power_factor": 0.5},
    "the same views 20 K warmer": {"warming_k": 20.0},
    "the same views with the rig moving sideways at 0.5 m/s": {"velocity": [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]},
    "the same views with the rig turning about its vertical axis at 1 rad/s": {"velocity": [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]},
    "two more repeats of each view": {"repeats": 2},
}
_OTHER_VIEWS = "other views: another distance (at least twice as far) and other materials"


def _changed(frame, power_factor=1.0, exposure_factor=1.0, warming_k=0.0, velocity=None, repeats=0):
    temperature_c = frame.temperature_c
    if warming_k:
        temperature_c = (REFERENCE_TEMPERATURE_C if temperature_c is None else temperature_c) + warming_k
    return replace(
        frame, projector_power=power_factor * frame.projector_power, exposure_s=exposure_factor * frame.exposure_s,
        temperature_c=temperature_c, camera_velocity=frame.camera_velocity if velocity is None else np.array(velocity),
    )  # fmt: skip


def next_measurements(ranking, evidence):
    """[{text, nats, separates, change}] best first; empty where nothing is open. change: of the menu's frames, None for other advice."""
    if not evidence.has_floor:
        text = "repeat every static view at least twice: without repeats the noise floor is unknown"
        return [{"text": text, "nats": None, "separates": [], "change": None}]
    members = _open_set(ranking)
    if len(members) < 2:
        return []
    observations = scan_observations(evidence.train)
    scored = []
    for text, change in _MENU.items():
        nats, pair = _worst_pair(ranking, evidence, members, observations, change)
        scored.append((nats, text, pair))
    scored.sort(key=lambda entry: -entry[0])
    useful = [entry for entry in scored if entry[0] > _WORTH_NATS][:_SUGGESTIONS]
    if not useful:
        names = [e.id for e in members]
        return [{"text": _OTHER_VIEWS, "nats": None, "separates": names, "change": None}]
    return [
        {"text": f"{text} (expected {nats:.0f} nats)", "nats": nats, "separates": list(pair), "change": _MENU[text]}
        for nats, text, pair in useful
    ]


def _open_set(ranking):
    best = ranking.entries[0] if ranking.entries else None
    if best is None or best.nats <= 0 or best.solution is None:
        return []
    names = {best.id, *equivalents(ranking, best)}
    return [e for e in ranking.entries if e.id in names and e.solution is not None][:_MEMBERS]


def _worst_pair(ranking, evidence, members, observations, change):
    frames = [_changed(o.frame, **change) for o in observations]
    changed = [replace(o, frame=f, view=replace(o.view, frame=f)) for o, f in zip(observations, frames, strict=True)]
    images = {e.id: [_image(e, o) for o in changed] for e in members}
    worst = (np.inf, ())
    for first, second in combinations(members, 2):
        nats = _distance(changed, images[first.id], images[second.id], evidence.law) / ranking.deff
        worst = min(worst, (float(nats), (first.id, second.id)))
    return worst


def _image(entry, o):
    s = entry.solution
    return signal(s.model, o, s.model.light(o.layers, o.view, fine=False), s.phi)


def _distance(observations, first, second, law):
    """Half the squared distance of two sets of images in deviations, after the best change of scales and black level."""
    gram, moment, total = np.zeros((3, 3)), np.zeros(3), 0.0
    for o, a, b in zip(observations, first, second, strict=True):
        weight = 1.0 / np.maximum(law.variance(0.5 * (a + b), o.frame.gain), 1.0 / 12.0)
        light = o.frame.exposure_gain
        columns = np.stack([o.layers.projector * o.frame.projector_power * light, o.layers.ambient * light, np.ones(a.shape)]).reshape(3, -1)
        w, d = weight.ravel(), (a - b).ravel()
        gram, moment, total = gram + (columns * w) @ columns.T, moment + columns @ (w * d), total + w @ d**2
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-30))
    step = np.linalg.lstsq(gram / np.outer(norm, norm), moment / norm, rcond=1e-10)[0]
    return 0.5 * max(total - step @ (moment / norm), 0.0)
