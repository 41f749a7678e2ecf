# SPDX-License-Identifier: Apache-2.0
"""Finds where views and projector stand, from the images, beside what the capture states of them.

The search is Gauss-Newton on the nuisances of a fit without further effects (fitter.py): where the corrections change
the images by more than the rest of a linear step may err, the capture is rendered again from where it stands. The
prior stays around what is stated, so that a later fit with an effect is free to take a correction back.

Rolling shutters, clocks and motion blur displace moving views, too: one that would be corrected by far more than the
views at rest stays where it is stated, for an effect to explain.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from activestereo.capture.capture import SIDES, Capture
from activestereo.compare.cache import LayerCache, scene_digest
from activestereo.compare.render import LayersOfFrames
from activestereo.diagnose.evidence import Evidence, Geometry, Observation, gather
from activestereo.diagnose.evidence.geometry import TWIST
from activestereo.diagnose.refine.fit_cache import code_digest, content_key, effect_content
from activestereo.diagnose.refine.fitter import Fitter
from activestereo.diagnose.refine.light import SCALES
from activestereo.diagnose.refine.parameter_space import ParameterSpace, Solution
from activestereo.diagnose.score.likelihood import design_effect
from activestereo.effects import Model

# What a Geometry holds beside the capture.
_FOUND = ("focal", "projector", "poses", "deviations")
_MOST_ROUNDS = 2
_ITERATIONS = 4
# Images are rendered again where corrections change them by more than this share of the noise, in the quadratic mean.
_LINEAR_SHARE = 0.1
# A moving view is off by at most so many times what the views at rest are, and by so many stated deviations.
_MOVING_RATIO, _MOVING_SIGMAS = 2.0, 2.0


Render = Callable[[Capture], LayersOfFrames]


def gather_where_it_stands(
    capture: Capture,
    render: Render,
    model: Model,
    seed: int = 0,
    threads: int = 1,
    memory: LayerCache | None = None,
    rendered_by: object = None,
) -> Evidence:
    """The Evidence of the capture with its geometry corrected. capture: as stated. render: the layers of a capture.
    model: the effects that are known already. memory: where the geometry is kept for a second diagnosis; rendered_by:
    all that decides the layers of a capture, for its key."""
    key = None if memory is None else _key(capture, model, seed, rendered_by)
    known = None if memory is None or key is None else memory.get_arrays(key)
    if known is not None:
        geometry = replace(Geometry.as_stated(capture), **{name: known[f"geometry/{name}"] for name in _FOUND})
        capture = geometry.capture()
        return gather(capture, render(capture), seed, geometry)
    evidence = _searched(capture, render, model, seed, threads)
    if memory is not None and key is not None:
        memory.put_arrays(key, {f"geometry/{name}": getattr(evidence.geometry, name) for name in _FOUND})
    return evidence


def _key(capture: Capture, model: Model, seed: int, rendered_by: object) -> str | None:
    """The key of all that decides where a capture stands; None where a part of the model is a user's own."""
    effects = [(effect_content(effect), values) for effect, values in model.effects]
    if any(content is None for content, _ in effects):
        return None
    images = [(capture.ir(f, side), capture.known(f, side)) for f in capture.frames for side in SIDES]
    seen = capture, capture.rig.projector.pattern(), images, scene_digest(capture.scene_path)
    return content_key("geometry", code_digest(), *seen, effects, seed, rendered_by)


def _searched(capture: Capture, render: Render, model: Model, seed: int, threads: int) -> Evidence:
    """See gather_where_it_stands()."""
    evidence = gather(capture, render(capture), seed)
    as_stated = np.zeros(len(evidence.geometry.poses), dtype=bool)
    for _ in range(_MOST_ROUNDS):
        focal, twists, deviations = _step(evidence, model, threads)
        as_stated |= _moving_beyond_others(evidence, twists)
        twists[_of_poses(as_stated)] = -evidence.geometry.twists()[_of_poses(as_stated)]
        geometry = replace(evidence.geometry, deviations=deviations)
        if _change(evidence, focal, twists) < _LINEAR_SHARE:
            return replace(evidence, geometry=geometry)
        geometry = geometry.moved(focal, twists)
        moved = geometry.capture()
        evidence = gather(moved, render(moved), seed, geometry)
    return evidence


def _step(evidence: Evidence, model: Model, threads: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(relative focal lengths, twists, standard errors of both) from where the evidence was rendered: of the train
    frames, and of the test frames' own poses, which nothing else depends on."""
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles, threads=threads)
    space = ParameterSpace.of(model)
    solution = fitter.refine(space, space.start, fitter.phi0(evidence.nuisances), _ITERATIONS)
    phi, first = solution.phi.copy(), len(solution.theta) + SCALES
    variance = np.diag(fitter.inverse(solution))[first:].copy()
    own = _own_places(evidence)
    if own.size:
        test = Fitter(_tiled(evidence.test), evidence.nuisance_prior(), evidence.tiles, threads=threads)
        sums = test.linearise(space, solution.theta, phi, test.lights(space, solution.theta))
        prior = 1.0 / evidence.nuisance_prior().sigma[own] ** 2
        stated = -evidence.geometry.twists()[own - len(SIDES) - evidence.materials]
        gram = sums.gram.sum(0)[np.ix_(first + own, first + own)] + np.diag(prior)
        moment = sums.moment.sum(0)[first + own] - prior * (phi[SCALES + own] - stated)
        inverse = np.linalg.inv(gram)
        phi[SCALES + own] += inverse @ moment
        variance[own] = np.diag(inverse)
    design = design_effect(solution.sums.tile_chi2, evidence.tile_pixels) * max(
        1.0, solution.sums.total / evidence.pixels
    )
    focal, twists = np.split(_without_albedos(phi[SCALES:], evidence), [len(SIDES)])
    return focal, twists, np.sqrt(design * _without_albedos(variance, evidence))


def _without_albedos(stated: np.ndarray, evidence: Evidence) -> np.ndarray:
    """Focal lengths and twists of all that is stated."""
    return np.delete(stated, np.arange(evidence.materials) + len(SIDES))


def standing(evidence: Evidence, solution: Solution) -> Geometry:
    """The geometry under a solution: as stated, or as the evidence was rendered, where that makes no difference."""
    focal, twists = np.split(_without_albedos(solution.phi[SCALES:], evidence), [len(SIDES)])
    geometry = evidence.geometry
    if _change(evidence, geometry.focal + focal, geometry.twists() + twists) < _LINEAR_SHARE:
        return Geometry.as_stated(geometry.stated)
    return geometry if _change(evidence, focal, twists) < _LINEAR_SHARE else geometry.moved(focal, twists)


def _moving_beyond_others(evidence: Evidence, twists: np.ndarray) -> np.ndarray:
    """Which poses are of moving frames and would be corrected by far more than those of frames at rest, [poses]."""
    sigma = evidence.nuisance_prior().sigma[len(SIDES) + evidence.materials :]
    strain = np.abs((evidence.geometry.twists() + twists) / sigma).reshape(-1, TWIST)[1:].max(axis=1)
    moving = {f.id for f in evidence.capture.frames if f.is_moving}
    moves = np.array([not moving.isdisjoint(evidence.geometry.frames_of(row)) for row in range(len(strain))])
    return moves & (strain > max(_MOVING_SIGMAS, _MOVING_RATIO * strain[~moves].max(initial=0.0)))


def _of_poses(chosen: np.ndarray) -> np.ndarray:
    """Which numbers of Geometry.twists() belong to the chosen poses."""
    return np.repeat(np.concatenate([[False], chosen]), TWIST)


def _own_places(evidence: Evidence) -> np.ndarray:
    """Where the poses of test frames alone stand in NuisancePrior."""
    train = {int(place) for o in evidence.train for place in o.geometry_places}
    return np.array(sorted({int(place) for o in evidence.test for place in o.geometry_places} - train), dtype=np.intp)


def _tiled(observations: Sequence[Observation]) -> list[Observation]:
    """Test observations as a Fitter takes them: all in one tile and fold."""
    return [replace(o, tile=np.zeros_like(o.tile), fold=np.zeros_like(o.fold)) for o in observations]


def _change(evidence: Evidence, focal: np.ndarray, twists: np.ndarray) -> float:
    """The change of the images by a step, in noise deviations, quadratic mean of the image that it changes most."""
    stated = np.insert(np.concatenate([focal, twists]), [len(SIDES)] * evidence.materials, 0.0)
    squares = []
    for o in (*evidence.train, *evidence.test):
        change = stated[int(o.view.is_right)] * o.focal_slope
        change = change + np.tensordot(stated[o.geometry_places], o.geometry_slopes, axes=1)
        squares.append(float((change**2 * o.weight).mean()))
    return float(np.sqrt(max(squares)))
