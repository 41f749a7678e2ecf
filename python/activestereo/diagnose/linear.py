# SPDX-License-Identifier: Apache-2.0
"""The images near a fit as a linear model, and scores of a dictionary's columns under it.

A holds the nuisances' columns, with prior precision P and prior gradient o. C holds the dictionary's columns, and r is
the residual, all in noise deviations. With X = A C' and K = (A A' + P)^-1 (Schur's complement),

    information on the columns' coefficients    S = C C' - X' K X
    their score                                 u = C (r - A' K (A r - o))

Sums over pixels are kept separately for each surface, so that an effect on some surfaces needs no further columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.evidence import Evidence, Observation, one_of_each_situation
from activestereo.diagnose.fitter import Fitter, ParameterSpace, Solution
from activestereo.diagnose.kept import FitCache
from activestereo.diagnose.pixels import SCALES, Cluster, cluster_of, exposed
from activestereo.effects import Model
from activestereo.effects.core.surfaces import MOST_MATERIALS

# The linear model uses so many pixels, and the first fit so many Gauss-Newton steps.
_LOOKED_AT, _ROUNDS = 200_000, 3
_SEED = 11
# Scores see images of so many pixels of each setting: 16 poses of small images, 4 of 848 x 480.
_SCORED_PIXELS = 16 * 424 * 240
Columns = NDArray[np.float32]
# A surface with a smaller share of the pixels has no group of its own.
_LEAST_SURFACE = 0.002
Matrix = NDArray[np.float64]


def some_pixels(observations: Sequence[Observation], seed: int = 0) -> tuple[Observation, ...]:
    """Returns the observations with a random part of their pixels, about _LOOKED_AT in all. All images of one view and
    camera use the same pixels, so that their light is computed once."""
    share = min(1.0, _LOOKED_AT / max(sum(o.pixels for o in observations), 1))
    views: dict[Cluster, int] = {}
    out = []
    for o in observations:
        number = views.setdefault(cluster_of(o), len(views))
        rng = np.random.Generator(np.random.PCG64([_SEED, seed, number]))
        pool = np.arange(o.measured.size) if o.pick is None else o.pick
        out.append(replace(o, pick=np.sort(rng.permutation(pool)[: max(1, round(share * len(pool)))])))
    return tuple(out)


def scored(observations: Sequence[Observation]) -> tuple[Observation, ...]:
    """Returns the observations that serve scores and first steps of fits: one image of each situation."""
    return one_of_each_situation(observations, share=1.0, most_pixels=_SCORED_PIXELS)


@dataclass(frozen=True)
class Linear:
    """The linear model at a solution, over the pixels [n] of all the fitter's observations, concatenated.

    nuisances: [k][n], derivatives in noise deviations per unit. They are by the parameters of effects in the model,
    then scales and black level, focal lengths, albedos and geometry. precision, pull: of their priors, the precision
    and the gradient. residual: [n], in noise deviations. material: the index of the scene's surface at each pixel.
    """

    fitter: Fitter
    solution: Solution
    nuisances: Columns
    precision: NDArray[np.float64]
    pull: NDArray[np.float64]
    residual: Columns
    material: NDArray[np.int64]

    def images(self, model: Model) -> list[NDArray[np.float64]]:
        """Returns each observation's expected DN [pixels] under a model and the solution's nuisances."""
        pixels, phi = enumerate(self.fitter.pixels()), self.solution.phi
        return [exposed(model, p, self.fitter.light(model, i), phi)[0] for i, p in pixels]

    def change(self, model: Model, images: Sequence[NDArray[np.float64]]) -> Columns:
        """Returns the change from the given images to those of a model, in noise deviations [n]. images: expected DN
        [pixels] of each observation."""
        changes = zip(self.fitter.pixels(), self.images(model), images, strict=True)
        return np.concatenate([((new - old) * p.root_weight).astype(np.float32) for p, new, old in changes])


def linearised(fitter: Fitter, solution: Solution) -> Linear:
    """Makes the Linear model at a solution."""
    space, theta, phi = solution.space, solution.theta, solution.phi
    pixels, own, materials = fitter.pixels(), len(theta), fitter.materials
    ends = np.cumsum([0, *(len(p.index) for p in pixels)])
    A = np.zeros((own + len(phi), ends[-1]), np.float32)
    residual = np.zeros(ends[-1], np.float32)
    albedos = own + SCALES + 2
    slopes = fitter.pixel_slopes(space, theta, phi, fitter.lights(space, theta), own)
    for (p, columns, rest), first, end in zip(slopes, ends[:-1], ends[1:], strict=True):
        block, weight = A[:, first:end], p.root_weight
        for j, column in enumerate(columns):
            block[j] = column * weight
        glow = (columns[own] * phi[0] + columns[own + 1] * phi[1]) * weight
        for m in range(materials):
            block[albedos + m] = np.where(p.material == m, glow, 0.0)
        block[own + SCALES + p.observation.geometry_places] = p.geometry
        residual[first:end] = rest * weight
    prior, pull = fitter.prior(own, space), fitter.pull(phi, own, space, theta)
    surface = [p.gather(np.asarray(p.observation.layers.material)).astype(np.int64) for p in pixels]
    return Linear(fitter, solution, A, prior, pull, residual, np.concatenate(surface))


def as_gathered(evidence: Evidence, model: Model, memory: FitCache | None) -> Linear:
    """Returns the linear model at a fit to the scored images alone. It does not depend on how well a geometry search
    fits there, so first words and the search share image changes."""
    prior = replace(evidence, geometry=replace(evidence.geometry, misfit=1.0)).nuisance_prior()
    images = scored(some_pixels(evidence.train, evidence.seed))
    fitter = Fitter(images, prior, evidence.tiles, memory=memory)
    return linearised(fitter, fitted_model(fitter, model, fitter.phi0(evidence.nuisances)))


def fitted_model(fitter: Fitter, model: Model, phi: NDArray[np.float64]) -> Solution:
    """Fits a model and the nuisances, starting from the model's parameters and phi. Returns the Solution."""
    space = ParameterSpace.of(model)
    return fitter.refine(space, space.start, phi, _ROUNDS)


@dataclass(frozen=True)
class Scores:
    """Inner products over pixels of c columns and k nuisances, separately for each group of pixels. Each large surface
    is a group; the last group is all other pixels. gram [groups][c][c]: columns with columns. cross [groups][k][c]:
    nuisances with columns. moment [groups][c]: columns with the residual after the nuisances are fitted. surfaces: the
    surface index of each group but the last. inverse: K of the module's docstring. total: chi2 of that residual.
    pixels: the number of pixels."""

    gram: Matrix
    cross: Matrix
    moment: Matrix
    surfaces: tuple[int, ...]
    inverse: Matrix
    total: float
    pixels: int

    def select(self, columns: slice, surfaces: Sequence[int] | None = None) -> tuple[Matrix, Matrix]:
        """Returns (information [c][c], score [c]) of columns on some surfaces; None = on all."""
        groups: slice | list[int] = slice(None)
        if surfaces is not None:
            groups = [g for g, number in enumerate(self.surfaces) if number in surfaces]
        X = self.cross[:, :, columns][groups].sum(0)
        information = self.gram[:, columns, columns][groups].sum(0) - X.T @ self.inverse @ X
        return information, self.moment[:, columns][groups].sum(0)


def scores(linear: Linear, columns: Columns) -> Scores:
    """Returns the Scores of columns [c][n] under a linear model."""
    A, r = linear.nuisances, linear.residual
    K = (A @ A.T).astype(np.float64) + np.diag(linear.precision)
    norm = np.sqrt(np.maximum(np.diag(K), 1e-300))
    inverse = np.linalg.pinv(K / np.outer(norm, norm), rcond=1e-7, hermitian=True) / np.outer(norm, norm)
    step = inverse @ ((A @ r).astype(np.float64) - linear.pull)
    left = r - step.astype(np.float32) @ A
    numbers, counts = np.unique(linear.material, return_counts=True)
    large = numbers[(counts > _LEAST_SURFACE * len(r)) & (numbers < MOST_MATERIALS)]
    surfaces = tuple(map(int, large))
    group = np.where(np.isin(linear.material, large), np.searchsorted(large, linear.material), len(large))
    sums = []
    for g in range(len(surfaces) + 1):
        here = np.flatnonzero(group == g)
        C, rest = columns[:, here], left[here]
        sums.append([x.astype(np.float64) for x in (C @ C.T, A[:, here] @ C.T, C @ rest)])
    gram, cross, moment = (np.stack(x) for x in zip(*sums, strict=True))
    total = float(r @ r - step @ ((A @ r) - linear.pull))
    return Scores(gram, cross, moment, surfaces, inverse, total, len(r))


def score_alone(linear: Linear, change: Columns) -> tuple[float, float]:
    """Returns (information, score) of one image change [n] on all surfaces, as Scores.select() does."""
    information, score = scores(linear, change[None]).select(slice(0, 1))
    return float(information[0, 0]), float(score[0])
