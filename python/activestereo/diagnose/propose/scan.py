# SPDX-License-Identifier: Apache-2.0
"""Where to start a fit: a coarse scan of an effect's parameters around their priors, on few images, nuisances
refitted each time.

An effect whose likelihood has narrow peaks proposes its own starts (Effect.starts).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from activestereo.diagnose.evidence import Observation
from activestereo.diagnose.propose.surfaces import explained_surfaces, nowhere
from activestereo.diagnose.refine import Fitter, ParameterSpace
from activestereo.diagnose.score.occam import is_shape
from activestereo.effects import Effect, Light, Parameter, Stage
from activestereo.effects.core.judging import StartImage
from activestereo.effects.core.model import scales

# Amplitudes that are tried, in typical values.
_MULTIPLES = (0.3, 1.0, 3.0)
# Of the way to the end of a range that is only a few deviations long: a threshold acts nowhere but near its place.
_SHARES = (0.5, 0.65, 0.8)
_SHORT_RANGE = 4.0
_LARGEST_SCAN = 24
# Shares of what an effect explained alone that are tried beside the one that was added before it.
_SHARES_OF_BLAME = (0.4, 1.0)
_STARTS = 2
_PICKED_SHARE = 0.25
_SEED = 11


@dataclass(frozen=True)
class Start:
    """Where a fit may begin: effect parameters theta and nuisances phi, and their chi2."""

    chi2: float
    theta: np.ndarray
    phi: np.ndarray


def scan_observations(observations: Sequence[Observation], seed: int = 0) -> tuple[Observation, ...]:
    """One image of each situation: the right camera (which every camera effect touches), one frame per pose and
    setting, and one of the left camera, which the right one may differ from; a random part of the pixels counts.
    """
    seen: set[tuple] = set()
    left = _left_image(observations)
    chosen: list[Observation] = []
    for o in observations:
        f = o.frame
        setting = (
            f.camera_to_world.tobytes(),
            f.exposure_gain,
            f.projector_power,
            f.ambient,
            f.temperature_c,
            f.is_moving,
        )
        if o is left or (o.side == "right" and setting not in seen):
            seen |= {setting} if o.side == "right" else set()
            rng = np.random.Generator(np.random.PCG64([_SEED, len(chosen), seed]))
            picked = np.sort(rng.permutation(o.pixels)[: int(_PICKED_SHARE * o.pixels)])
            picked = picked if o.pick is None else o.pick[picked]
            chosen.append(replace(o, pick=picked))
    return tuple(chosen)


def _left_image(observations: Sequence[Observation]) -> Observation | None:
    """The first of the left camera, or its last repeat: light that flickers is seen at one more instant then."""
    left = [o for o in observations if o.side == "left"]
    group = left[0].frame.repeat_group if left else None
    repeats = [o for o in left if o.frame.repeat_group == group] if group is not None else left[:1]
    return repeats[-1] if repeats else None


def starts(
    fitter: Fitter,
    space: ParameterSpace,
    candidate: Effect,
    phi: np.ndarray,
    limit: float,
    alone: np.ndarray | None = None,
) -> list[Start]:
    """The best few Starts of a scan with a chi2 below the limit, best first.

    alone: the candidate's parameters as fitted without the effect that was added before it, or None. That effect is
    then scanned beside them and beside a part of them, too: it may have been fitted to what is the candidate's.
    """

    def scanned() -> dict[str, np.ndarray]:
        best = _scanned(fitter, space, candidate, phi, limit, alone)
        return {name: np.array([getattr(start, name) for start in best]) for name in ("chi2", "theta", "phi")}

    found = fitter.remembered(scanned, space, "starts", phi, limit, alone)
    return [Start(*one) for one in zip(found["chi2"].tolist(), found["theta"], found["phi"], strict=True)]


def _scanned(
    fitter: Fitter, space: ParameterSpace, candidate: Effect, phi: np.ndarray, limit: float, alone: np.ndarray | None
) -> list[Start]:
    """See starts()."""
    first = len(space.pairs) - len(candidate.parameters)
    points = _own_points(fitter, space, candidate, phi) or _points(candidate)
    tried = [(list(range(first, len(space.pairs))), p) for p in points]
    stage = candidate.stage
    if alone is not None and first:
        before = space.pairs[first - 1][0]
        both = [i for i, (e, _) in enumerate(space.pairs) if e.id == before.id] + list(range(first, len(space.pairs)))
        neutral = np.array([p.neutral for p in candidate.parameters])
        beside = (neutral + share * (alone - neutral) for share in _SHARES_OF_BLAME)
        tried += [(both, np.concatenate([p, b])) for b in beside for p in _points(before)]
        stage = max(stage, before.stage)
    rounds = 1 if stage <= Stage.OPTICS else 3
    moves_light = space.in_light[min(index[0] for index, _ in tried) :].any()
    fixed_lights = None if moves_light else fitter.lights(space, space.start)
    on_some = bool(space.given[first:].any())
    scored: list[Start] = []
    for index, values in tried:
        theta = space.start.copy()
        theta[index] = np.clip(values, space.low[index], space.high[index])
        # What fits no surface well may fit some of them.
        least = np.inf if on_some else _least_wanted(scored, limit)
        scored.append(_start(fitter, space, theta, phi, fixed_lights, rounds, least))
    if on_some:
        scored += _on_some_surfaces(fitter, space, scored, phi, rounds)
    return sorted((s for s in scored if s.chi2 < limit), key=lambda start: start.chi2)[:_STARTS]


def _least_wanted(scored: Sequence[Start], limit: float) -> float:
    """The chi2 that another start has to fall below to be one of the best few."""
    best = sorted(start.chi2 for start in scored)[:_STARTS]
    return min(limit, best[-1]) if len(best) == _STARTS else limit


def _start(
    fitter: Fitter,
    space: ParameterSpace,
    theta: np.ndarray,
    phi: np.ndarray,
    lights: Sequence[Light] | None,
    rounds: int,
    limit: float = np.inf,
) -> Start:
    """The Start at theta; lights: those at theta, where they are known."""
    phi_here, chi2 = fitter.nuisance_fit(space, theta, phi, lights or fitter.each_light(space, theta), rounds, limit)
    return Start(chi2, theta, phi_here)


def _own_points(fitter: Fitter, space: ParameterSpace, candidate: Effect, phi: np.ndarray) -> list[np.ndarray]:
    """Parameter vectors that the effect itself proposes; none where it does not."""
    if candidate.starts is None:
        return []
    proposed = candidate.starts(start_images(fitter, space, phi))
    return [
        np.array([np.clip(values.get(p.name, p.neutral), p.low, p.high) for p in candidate.parameters])
        for values in proposed
    ]


def start_images(fitter: Fitter, space: ParameterSpace, phi: np.ndarray) -> list[StartImage]:
    """The fitter's images at the start of a space, at which an effect's own proposals look."""
    lights = fitter.lights(space, space.start)
    images = []
    for (o, slopes, residual), light in zip(fitter.slopes(space, space.start, phi, lights, 0), lights, strict=True):
        ambient_dn = phi[1] * scales(o.frame)[1]
        seen = residual if o.view.known is None else np.where(o.view.known, residual, 0.0)
        images.append(StartImage(o.view, light, o.weight, seen, slopes[1] * phi[1], ambient_dn))
    return images


def _on_some_surfaces(
    fitter: Fitter, space: ParameterSpace, scored: Sequence[Start], phi: np.ndarray, rounds: int
) -> list[Start]:
    """The same starts on those surfaces alone where they explain something, where these are neither all nor none."""
    out = []
    without = nowhere(fitter, space, phi)
    for start in scored:
        changed = start.theta.copy()
        changed[space.given] = explained_surfaces(fitter, space, start.theta, phi, without)
        if changed[space.given].any():
            out.append(_start(fitter, space, changed, phi, None, rounds))
    return out


def _points(candidate: Effect) -> list[np.ndarray]:
    """Parameter vectors: each amplitude alone over multiples of its prior's deviation, with every choice of the
    shape parameters.
    """
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
    # Points of one shape follow each other: effects remember what an amplitude does not change.
    return sorted(points, key=lambda point: tuple(point[shapes]))


def _levels(p: Parameter) -> list[float]:
    out = []
    for side in (1.0, -1.0):
        reach = p.high - p.neutral if side > 0 else p.neutral - p.low
        out += [p.neutral + side * m * p.typical for m in _MULTIPLES if m * p.typical <= reach * (1 + 1e-9)]
        if 0 < reach < _SHORT_RANGE * p.typical:
            out += [p.neutral + side * share * reach for share in _SHARES]
    return out


def _choices(p: Parameter) -> list[float]:
    """The neutral value, and where the range is one-signed a geometric ladder over it."""
    if p.low > 0:
        ladder = np.geomspace(max(p.low, 0.2 * p.neutral), min(p.high, 4.0 * p.neutral), 5)
        return sorted({p.neutral, *ladder.tolist()})
    around = (p.neutral, p.neutral + p.typical, p.neutral - p.typical)
    return sorted({v for v in around if p.low <= v <= p.high})
