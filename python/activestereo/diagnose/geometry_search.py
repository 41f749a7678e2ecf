# SPDX-License-Identifier: Apache-2.0
"""Estimates the poses of views and projector from the images, starting from the poses that the capture states.

The search is Gauss-Newton on the nuisances of a fit (fitter.py), first on blurred images. If corrections change the
images by more than a linear step allows, the capture is rendered again at the corrected poses. The prior stays around
the stated poses, so that a later fit with an effect can take a correction back.

A lens distortion is fitted too if the images need one. Otherwise focal lengths and poses would absorb a part of it.

Rolling shutters, clocks and motion blur also displace moving views. A moving view whose correction is far larger than
those of views at rest keeps its stated pose, so that an effect can explain it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from typing import Any

import numpy as np

from activestereo.capture.capture import SIDES, Capture
from activestereo.common.normal_matrix import inverse_normal_matrix
from activestereo.common.processes import forked
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import LayersOfFrames
from activestereo.diagnose.evidence import Evidence, NuisancePrior, Observation, one_of_each_situation
from activestereo.diagnose.fitter import Fitter, ParameterSpace, Solution
from activestereo.diagnose.gather import gather, held_out
from activestereo.diagnose.geometry import TWIST, Geometry
from activestereo.diagnose.goodness import design_effect
from activestereo.diagnose.kept import capture_content, code_digest, content_key, effect_content
from activestereo.diagnose.pixels import SCALES
from activestereo.effects import Model, builtin
from activestereo.effects.core.resample import blur
from activestereo.effects.core.view import Layers

# Least known share of a blurred pixel, against division by zero.
_LEAST = 1e-6
# The fields of a Geometry that the cache keeps.
_FOUND = ("focal", "projector", "poses", "deviations", "misfit", "left")
# Blurs of the images, one round each. Dots are about a pixel wide.
_BLURS_PX = (3.0, 0.0)
_ITERATIONS = 4
# Random share of an image's pixels that a search uses, and their largest number. They tell the rig's pose to a few
# hundredths of the noise.
_PIXEL_SHARE, _MOST_PIXELS, _SEED = 0.25, 12_000, 13
# Effects on this field of the engine are lenses that may be fitted along; the share of chi2 that one must remove.
_LENS, _WORTH = "camera.distortion", 0.2
# Lens parameters to try, in typical values; the scan uses every so manyth pixel of the chosen images.
_SCANNED, _SCANNED_PIXEL = (0.3, 1.0, 3.0, -0.3, -1.0, -3.0), 4
# Corrections that change the images by more than the first share of the noise, root mean square, are told, and rendered
# beside named effects, whose rivals they decide. The first search renders by the second, because slopes tell smaller
# changes but for a few edges. By more than the third, it begins with blurred images.
_TOLD_SHARE, _LINEAR_SHARE, _FAR_SHARE = 0.1, 0.3, 0.5
# A moving view may be off by so many times the error of the views at rest, and by so many stated deviations.
_MOVING_RATIO, _MOVING_SIGMAS = 2.0, 2.0
# A survey is never off by so many stated deviations: a misfitting model moves the rig to hide its error.
_BELIEVED_SIGMAS = 10.0
Render = Callable[[Capture], LayersOfFrames]


class GivenUp(Exception):
    """Ends a search whose first step leaves more of the images than the caller allows."""


def coarse(o: Observation, sigma_px: float) -> Observation:
    """Returns the observation under a Gaussian blur of measured image, lights and slopes. Of the pixels, only every
    sigma_px-th of every sigma_px-th row counts."""
    known = o.view.known
    share: np.ndarray | float = 1.0 if known is None else np.maximum(blur(known.astype(np.float32), sigma_px), _LEAST)

    def seen(image: np.ndarray) -> np.ndarray:
        inside = image if known is None else np.where(known, image, 0.0)
        return blur(np.asarray(inside, dtype=np.float32), sigma_px) / share

    direct, indirect, ambient, flat = (
        seen(getattr(o.layers, name)).astype(np.float64) for name in ("direct", "indirect", "ambient", "flat")
    )
    step, (height, width) = max(1, round(sigma_px)), o.measured.shape
    at = np.add.outer(np.arange(step // 2, height, step) * width, np.arange(step // 2, width, step)).ravel()
    return replace(
        o,
        layers=Layers(direct, indirect, ambient, flat, o.layers.depth_m, o.layers.normal, o.layers.material),
        measured=seen(o.measured).astype(np.float64),
        focal_slope=seen(o.focal_slope),
        geometry_slopes=np.stack([seen(slope) for slope in o.geometry_slopes]),
        pick=at if known is None else at[known.ravel()[at]],
    )


@dataclass(frozen=True)
class _Step:
    """One correction of the geometry. focal: relative changes of the focal lengths. twists: changes of poses in the
    order of Geometry.twists(). deviations: standard errors of focal, then of twists. misfit: as in Geometry. left: mean
    square of the remaining residual, in noise variances."""

    focal: np.ndarray
    twists: np.ndarray
    deviations: np.ndarray
    misfit: float
    left: float


def gather_where_it_stands(
    capture: Capture,
    render: Render,
    model: Model,
    seed: int = 0,
    memory: LayerCache | None = None,
    rendered_by: object = None,
    near: Evidence | None = None,
    draft: Render | None = None,
    seen: Callable[[Evidence], object] = lambda evidence: None,
    workers: int = 1,
    at_most: float = np.inf,
) -> Evidence:
    """Estimates the poses of views and projector under a model, renders there, and returns the Evidence of the train
    frames. capture: states the poses to start from. render: returns a capture's layers. model: the effects known
    already. memory: keeps the estimated poses, so that a later diagnosis skips the search. rendered_by: all that
    determines the layers, for the key of `memory`. near: evidence under another model to start from. It is returned
    unchanged if the estimated poses are its own. draft: renders with fewer samples, on the way; None = render. seen:
    called with the first evidence that is gathered, before a search. workers: number of processes. at_most: raises
    GivenUp if the first step leaves more (Geometry.left)."""
    key = None if memory is None else _key(capture, model, seed, rendered_by, near)
    known = None if memory is None or key is None else memory.get_arrays(key)
    if known is not None:
        found: dict[str, Any] = {name: known[f"geometry/{name}"] for name in _FOUND}
        # The type must be the same as when it was found: keys of fits tell a number from an array.
        numbers = {name: float(found[name]) for name in ("misfit", "left")}
        stands = replace(Geometry.as_stated(capture), **found | numbers)
        if stands.left > at_most:
            raise GivenUp
        if near is not None and stands.is_same(near.geometry):
            return near
        capture = stands.capture()
        evidence = gather(capture, render(capture), seed, stands)
        seen(evidence)
        return evidence

    if near is None:
        evidence = gather(capture, render(capture), seed)
        seen(evidence)
        step = _step(evidence, model, 0.0, workers)
    else:
        evidence, step = _start(near, capture, render, model, workers)
    if (left := step.left) > at_most:
        raise GivenUp
    change, linear_share = _change(evidence, step.focal, step.twists), _LINEAR_SHARE if near is None else _TOLD_SHARE
    # If sharp images need a large correction, blurred ones reveal it. Without blurs the first step counts: a view's
    # move has hidden the model's effect so far.
    is_rough = near is None and change >= _FAR_SHARE
    plan: list[float | None] = [*_BLURS_PX, 0.0] if is_rough else [None, 0.0]
    is_draft = False
    for number, sigma_px in enumerate(plan if change >= linear_share else (), 1):
        by = draft if draft is not None and is_rough and number < len(plan) else render
        if sigma_px is not None:
            step = _step(evidence, model, sigma_px, workers)
        geometry = _corrected(evidence, step.focal, step.twists)
        if geometry is None and is_draft and by is render:
            geometry = evidence.geometry
        if geometry is not None:
            del evidence  # one at a time: those of large images take gigabytes
            capture, is_draft = geometry.capture(), by is draft
            evidence = gather(capture, by(capture), seed, geometry)
    stands = replace(evidence.geometry, deviations=step.deviations, misfit=step.misfit, left=left)
    evidence = replace(evidence, geometry=stands)
    if memory is not None and key is not None:
        memory.put_arrays(key, {f"geometry/{name}": getattr(stands, name) for name in _FOUND})
    return near if near is not None and stands.is_same(near.geometry) else evidence


def _start(near: Evidence, capture: Capture, render: Render, model: Model, workers: int) -> tuple[Evidence, _Step]:
    """Returns the evidence to start from and the first step there: near, or the evidence at the stated geometry if that
    fits better. Poses found without an effect absorb a part of it. They may move dots by more than their width, and so
    hide the effect."""
    step = _step(near, model, 0.0, workers)
    if near.geometry.is_as_stated() or _change(near, step.focal, step.twists) < _TOLD_SHARE:
        return near, step
    near.forget()
    stated = gather(capture, render(capture), near.seed)
    from_stated = _step(stated, model, 0.0, workers)
    return (stated, from_stated) if from_stated.left < step.left else (near, step)


def _key(capture: Capture, model: Model, seed: int, rendered_by: object, near: Evidence | None) -> str | None:
    """Returns the cache key of a geometry search; None if the model has a user's own effect."""
    effects = [(effect_content(effect), values) for effect, values in model.effects]
    if any(content is None for content, _ in effects):
        return None
    start = None if near is None else (near.geometry.focal, near.geometry.twists())
    return content_key("geometry", code_digest(), capture_content(capture), effects, seed, rendered_by, start)


def _corrected(evidence: Evidence, focal: np.ndarray, twists: np.ndarray) -> Geometry | None:
    """Returns the corrected geometry; None if the images hardly change. Moving poses with far larger corrections than
    the others go back to their stated values."""
    twists, stated = twists.copy(), _pose_mask(_moving_beyond_others(evidence, twists))
    twists[stated] = -evidence.geometry.twists()[stated]
    if _change(evidence, focal, twists) < _TOLD_SHARE:
        return None
    return evidence.geometry.moved(focal, twists)


def _step(evidence: Evidence, model: Model, blur_px: float = 0.0, workers: int = 1) -> _Step:
    """Returns one correction of the geometry. It fits train frames at rest, then the poses that only moving frames
    have. Moving frames influence no other unknown, because motion has effects beyond geometry."""
    at_rest = [o for o in evidence.train if not o.frame.is_moving] or list(evidence.train)
    fitted = {o.key for o in at_rest}
    others = [_thinned(o, blur_px, evidence.seed) for o in evidence.train if o.key not in fitted]
    at_rest = [_thinned(o, blur_px, evidence.seed) for o in at_rest]
    misfit = 1.0
    fitter, solution = _fit_at_rest(evidence, misfit, at_rest, model, blur_px, workers)
    if np.abs(_drop_albedos(fitter.sigmas(solution.phi), evidence)).max() > _BELIEVED_SIGMAS:
        start, phi0 = ParameterSpace.of(model), fitter.phi0(evidence.nuisances)
        misfit = _misfit(fitter, fitter.refine(start, start.start, phi0, 0))
        fitter, solution = _fit_at_rest(evidence, misfit, at_rest, model, blur_px, workers)
    phi = solution.phi.copy()
    variance = np.diag(fitter.inverse(solution))[len(solution.theta) + SCALES :].copy()
    fitted_places, all_places = ({int(p) for o in group for p in o.geometry_places} for group in (at_rest, others))
    own = np.array(sorted(all_places - fitted_places), dtype=np.intp)  # of poses that only moving frames have
    if own.size:
        # Frames at rest tell nothing of effects that only motion shows: weak priors pull these to neutral there, and
        # the moving frames tell them beside their poses.
        known, n = ParameterSpace.of(model).start, len(solution.theta)
        at = solution.space, np.concatenate([known, solution.theta[len(known) :]]), phi
        held = fitter.prior(n, solution.space)[:n] + np.diag(solution.sums.gram)[:n]
        moved, variance[own] = _own_step(evidence, others, fitter.nuisance_prior, own, *at, held, not blur_px)
        phi[SCALES + own] += moved
    focal, twists = np.split(_drop_albedos(phi[SCALES:], evidence), [len(SIDES)])
    deviations = np.sqrt(_misfit(fitter, solution) * _drop_albedos(variance, evidence))
    return _Step(focal, twists, deviations, misfit, solution.sums.total / fitter.tile_pixels().sum())


def _own_step(
    evidence: Evidence,
    others: Sequence[Observation],
    prior: NuisancePrior,
    own: np.ndarray,
    space: ParameterSpace,
    theta: np.ndarray,
    phi: np.ndarray,
    held: np.ndarray | None,
    supersampled: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Returns (step, variance) of the nuisances at indices `own`, on which only the observations `others` depend. held:
    precision of each entry of theta from priors and other observations; theta is then fitted too. None: theta stays
    fixed."""
    in_one_tile = [replace(o, tile=np.zeros_like(o.tile)) for o in others]
    fitter = Fitter(in_one_tile, prior, evidence.tiles, supersampled)
    sums = fitter.linearise(space, theta, phi, fitter.lights(space, theta))
    known = np.zeros(0) if held is None else held
    at = np.append(np.arange(len(known)), len(theta) + SCALES + own)
    precision = np.append(known, 1.0 / prior.sigma[own] ** 2)
    stated = -evidence.geometry.twists()[own - len(SIDES) - evidence.materials]
    pull = precision * np.append(np.zeros(len(known)), phi[SCALES + own] - stated)
    inverse = inverse_normal_matrix(sums.gram[np.ix_(at, at)] + np.diag(precision))
    step = inverse @ (sums.moment[at] - pull)
    return step[len(known) :], np.diag(inverse)[len(known) :]


def with_test_frames(evidence: Evidence, fitter: Fitter, solution: Solution, model: Model, render: Render) -> Evidence:
    """Returns the evidence with test frames at poses estimated under a solution's nuisances and `model`, its model with
    original image functions (restore_functions()). render: returns the layers of a capture's test frames."""
    space, phi, unmoved = ParameterSpace.of(model), solution.phi, np.zeros(len(SIDES))
    held = _pose_mask(evidence.geometry.held_out())
    own = len(SIDES) + evidence.materials + np.flatnonzero(held)

    def again(geometry: Geometry) -> Evidence:
        capture = geometry.capture()
        test = held_out(evidence, capture, render(capture))
        return replace(evidence, capture=capture, geometry=geometry, test=test)

    def step(there: Evidence, blur_px: float) -> tuple[np.ndarray, np.ndarray]:
        twists = np.zeros(len(held))
        others = [_thinned(o, blur_px, evidence.seed) for o in there.test if np.isin(o.geometry_places, own).any()]
        prior = there.nuisance_prior()
        twists[held], variance = _own_step(there, others, prior, own, space, space.start, phi, None, not blur_px)
        return twists, variance

    def moved(there: Evidence, twists: np.ndarray) -> Evidence:
        geometry = _corrected(there, unmoved, twists)
        return there if geometry is None else again(geometry)

    there = again(evidence.geometry)
    if not held.any():
        return there
    twists, variance = step(there, 0.0)
    if _change(there, unmoved, twists) >= _TOLD_SHARE:
        for sigma_px in _BLURS_PX:
            there = moved(there, step(there, sigma_px)[0])
        twists, variance = step(there, 0.0)
        there = moved(there, twists)
    deviations = there.geometry.deviations.copy()
    deviations[len(SIDES) :][held] = np.sqrt(_misfit(fitter, solution) * variance)
    return replace(there, geometry=replace(there.geometry, deviations=deviations))


def _thinned(o: Observation, blur_px: float, seed: int) -> Observation:
    """Returns the observation blurred by blur_px. If blur_px is 0, it returns a random part of the pixels instead, the
    same part in all frames of one camera and pose."""
    if blur_px:
        return coarse(o, blur_px)
    view = int.from_bytes(blake2b(o.side.encode() + o.frame.camera_to_world.tobytes(), digest_size=8).digest(), "big")
    pool = np.arange(o.measured.size) if o.pick is None else o.pick
    chosen = np.random.Generator(np.random.PCG64([_SEED, view, seed])).permutation(len(pool))
    count = min(round(_PIXEL_SHARE * len(pool)), _MOST_PIXELS)
    return replace(o, pick=np.sort(pool[chosen[:count]]))


def _fit_at_rest(
    evidence: Evidence, misfit: float, at_rest: Sequence[Observation], model: Model, blur_px: float, workers: int
) -> tuple[Fitter, Solution]:
    """Fits the frames at rest with the likelihood divided by the misfit; returns (fitter, solution). If sharp images
    need a correction, it fits again with a lens distortion, which may be the true cause."""
    prior = replace(evidence, geometry=replace(evidence.geometry, misfit=misfit)).nuisance_prior()
    fitter = Fitter(at_rest, prior, evidence.tiles, not blur_px)
    start, phi0 = ParameterSpace.of(model), fitter.phi0(evidence.nuisances)
    solution = fitter.refine(start, start.start, phi0, _ITERATIONS)
    moves = np.split(_drop_albedos(solution.phi[SCALES:], evidence), [len(SIDES)])
    if not blur_px and _change(evidence, *moves) >= _TOLD_SHARE:
        with_lens = _lens_start(evidence, model, fitter, phi0, workers)
        solution = solution if with_lens is None else fitter.refine(*with_lens, phi0, _ITERATIONS)
    return fitter, solution


def _misfit(fitter: Fitter, solution: Solution) -> float:
    """Returns the factor by which the likelihood overcounts pixels, from the scatter of the tiles' chi2."""
    tiles, pixels = solution.sums.tile_chi2 > 0, fitter.tile_pixels()
    design = design_effect(solution.sums.tile_chi2[tiles], pixels[tiles])
    return design * max(1.0, solution.sums.total / pixels.sum())


def _lens_start(
    evidence: Evidence, model: Model, fitter: Fitter, phi: np.ndarray, workers: int
) -> tuple[ParameterSpace, np.ndarray] | None:
    """Returns (parameter space, theta) to start a fit with a lens distortion; None if a scan finds none that helps.
    From neutral a fit would not find the distortion: nuisances absorb its displacements."""
    own, known = ParameterSpace.of(model), {effect.id for effect, _ in model.effects}
    lenses = [e for e in builtin().values() if e.engine_fields == (_LENS,) and e.id not in known]
    picked = one_of_each_situation(evidence.train, evidence.seed)
    seen = [replace(o, pick=np.arange(o.measured.size)[o.picked()][::_SCANNED_PIXEL]) for o in picked]
    scan = Fitter(seen, fitter.nuisance_prior, evidence.tiles, supersampled=False)

    trials = [(own, own.start)]
    for lens in lenses:
        space = ParameterSpace.of(model, lens)
        for i, p in enumerate(lens.parameters, len(own.start)):
            for level in (m * p.typical for m in _SCANNED if p.low <= m * p.typical <= p.high):
                trials.append((space, space.start.copy()))
                trials[-1][1][i] = level

    def chi2(trial: tuple[ParameterSpace, np.ndarray]) -> float:
        return scan.nuisance_fit(*trial, phi)[1]

    done = {i: work.result() for i, work in forked(chi2, trials, workers) if work.exception() is None}
    left = [done[i] if i in done else chi2(trial) for i, trial in enumerate(trials)]
    best = int(np.argmin(left))
    return trials[best] if left[best] < (1.0 - _WORTH) * left[0] else None


def _drop_albedos(stated: np.ndarray, evidence: Evidence) -> np.ndarray:
    """Returns a vector in the order of NuisancePrior without its albedos: focal lengths, then twists."""
    return np.delete(stated, np.arange(evidence.materials) + len(SIDES))


def standing(evidence: Evidence, solution: Solution) -> Geometry:
    """Returns the geometry under a solution, or the stated or rendered one if images hardly differ between them."""
    focal, twists = np.split(_drop_albedos(solution.phi[SCALES:], evidence), [len(SIDES)])
    geometry = evidence.geometry
    if _change(evidence, geometry.focal + focal, geometry.twists() + twists) < _TOLD_SHARE:
        return Geometry.as_stated(geometry.stated)
    return geometry if _change(evidence, focal, twists) < _TOLD_SHARE else geometry.moved(focal, twists)


def _moving_beyond_others(evidence: Evidence, twists: np.ndarray) -> np.ndarray:
    """Returns a mask [poses]: moving frames' poses whose total correction is far larger than those of poses at rest."""
    sigma = evidence.nuisance_prior().sigma[len(SIDES) + evidence.materials :]
    strain = np.abs((evidence.geometry.twists() + twists) / sigma).reshape(-1, TWIST)[1:].max(axis=1)
    moves = evidence.geometry.moving()
    return moves & (strain > max(_MOVING_SIGMAS, _MOVING_RATIO * strain[~moves].max(initial=0.0)))


def _pose_mask(chosen: np.ndarray) -> np.ndarray:
    """Returns a mask of the entries of Geometry.twists() that belong to the chosen poses. chosen: mask [poses]."""
    return np.repeat(np.concatenate([[False], chosen]), TWIST)


def _change(evidence: Evidence, focal: np.ndarray, twists: np.ndarray) -> float:
    """Returns how much a step changes the image that it changes most: root mean square in noise deviations."""
    stated = np.insert(np.concatenate([focal, twists]), [len(SIDES)] * evidence.materials, 0.0)
    squares = []
    for o in (*evidence.train, *evidence.test):
        change = stated[int(o.view.is_right)] * o.focal_slope
        change = change + np.tensordot(stated[o.geometry_places], o.geometry_slopes, axes=1)
        squares.append(float((change**2 * o.weight).mean()))
    return float(np.sqrt(max(squares)))
