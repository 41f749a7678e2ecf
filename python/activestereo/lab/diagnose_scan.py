"""Where to start a fit: a coarse scan of an effect's parameters around their priors, on few images, nuisances refitted each time."""

from dataclasses import replace
from itertools import product

import numpy as np

from activestereo.effects import Stage
from activestereo.lab.diagnose_occam import is_shape
from activestereo.lab.diagnose_periodic import periodic_points
from activestereo.lab.diagnose_surfaces import explained_surfaces
from activestereo.lab.diagnose_unit import unit_points

_MULTIPLES = (0.3, 1.0, 3.0)
# Of the way to the end of a range that is only a few deviations long: a threshold acts nowhere but near its place.
_SHARES = (0.5, 0.65, 0.8)
_SHORT_RANGE = 4.0
_LARGEST_SCAN = 24
_SHARES_OF_BLAME = (0.4, 1.0)
_STARTS = 2
_PICKED_SHARE = 0.25
_SEED = 11


def scan_observations(observations):
    """One image of each situation: the right eye (which every camera effect touches), one frame per pose and setting, and one of the
    left eye, which the right one may differ from; a random part of the pixels counts."""
    seen, chosen = set(), []
    for o in observations:
        f = o.frame
        setting = (f.camera_to_world.tobytes(), f.exposure_gain, f.projector_power, f.ambient, f.temperature_c, f.is_moving)
        if (o.eye == "right" and setting not in seen) or (o.eye == "left" and not any(c.eye == "left" for c in chosen)):
            seen |= {setting} if o.eye == "right" else set()
            rng = np.random.Generator(np.random.PCG64([_SEED, len(chosen)]))
            picked = np.sort(rng.permutation(o.measured.size)[: int(_PICKED_SHARE * o.measured.size)])
            chosen.append(replace(o, pick=picked))
    return chosen


def starts(fitter, play, candidate, phi, alone=None):
    """The best few (chi2, theta, phi) of a scan, best first, and the chi2 of the neutral start.

    alone: the candidate's parameters as fitted without the effect that was added before it, or None. That effect is then scanned
    beside them and beside a part of them, too: it may have been fitted to what is the candidate's."""
    first = len(play.free) - len(candidate.parameters)
    points = periodic_points(candidate, fitter, play, phi) or unit_points(candidate, fitter, play, phi) or _points(candidate)
    tried = [(np.arange(first, len(play.free)), p) for p in points]
    stage = candidate.stage
    if alone is not None and first:
        before = play.free[first - 1][0]
        both = [i for i, (e, _) in enumerate(play.free) if e.id == before.id] + list(range(first, len(play.free)))
        neutral = np.array([p.neutral for p in candidate.parameters])
        tried += [(both, np.concatenate([p, neutral + share * (alone - neutral)])) for p in _points(before) for share in _SHARES_OF_BLAME]
        stage = max(stage, before.stage)
    rounds = 1 if stage <= Stage.OPTICS else 3
    fixed_lights = None if play.in_light[min(index[0] for index, _ in tried) :].any() else fitter.lights(play, play.start)
    scored = []
    for index, values in tried:
        theta = play.start.copy()
        theta[index] = np.clip(values, play.low[index], play.high[index])
        lights = fixed_lights or fitter.lights(play, theta)
        phi_here, chi2 = fitter.nuisance_fit(play, theta, phi, lights, rounds)
        scored.append((chi2, theta, phi_here))
    if play.given[first:].any():
        scored += _on_some_surfaces(fitter, play, scored, phi, rounds)
    scored.sort(key=lambda entry: entry[0])
    return scored[:_STARTS]


def _on_some_surfaces(fitter, play, scored, phi, rounds):
    """The same starts on those surfaces alone where they explain something, where these are neither all nor none."""
    out = []
    for _, theta, _ in scored:
        changed = theta.copy()
        changed[play.given] = explained_surfaces(fitter, play, theta, phi)
        if changed[play.given].any():
            phi_here, chi2 = fitter.nuisance_fit(play, changed, phi, fitter.lights(play, changed), rounds)
            out.append((chi2, changed, phi_here))
    return out


def _points(candidate):
    """Parameter vectors: each amplitude alone over multiples of its prior's deviation, with every choice of the shape parameters."""
    parameters = candidate.parameters
    amplitudes = [i for i, p in enumerate(parameters) if not is_shape(p) and not p.choice]
    shapes = [i for i, p in enumerate(parameters) if is_shape(p)]
    neutral = np.array([p.neutral for p in parameters])
    points = []
    for i in amplitudes:
        for level in _levels(parameters[i]):
            for choice in product(*(_choices(parameters[s]) for s in shapes)):
                point = neutral.copy()
                point[i] = level
                point[shapes] = choice
                points.append(point)
    if len(points) > _LARGEST_SCAN:
        keep = np.linspace(0, len(points) - 1, _LARGEST_SCAN).round().astype(int)
        points = [points[i] for i in keep]
    return points


def _levels(p):
    out = []
    for side in (1.0, -1.0):
        reach = p.high - p.neutral if side > 0 else p.neutral - p.low
        out += [p.neutral + side * m * p.typical for m in _MULTIPLES if m * p.typical <= reach * (1 + 1e-9)]
        if 0 < reach < _SHORT_RANGE * p.typical:
            out += [p.neutral + side * share * reach for share in _SHARES]
    return out


def _choices(p):
    """The neutral value, and where the range is one-signed a geometric ladder over it."""
    if p.low > 0:
        ladder = np.geomspace(max(p.low, 0.2 * p.neutral), min(p.high, 4.0 * p.neutral), 5)
        return sorted({p.neutral, *ladder.tolist()})
    around = (p.neutral, p.neutral + p.typical, p.neutral - p.typical)
    return sorted({v for v in around if p.low <= v <= p.high})
