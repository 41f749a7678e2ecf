# SPDX-License-Identifier: Apache-2.0
"""The images near a fit as a linear model: the residual and a column for every nuisance, all in units of the noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.evidence import Observation
from activestereo.diagnose.refine import Fitter, ParameterSpace, Solution
from activestereo.diagnose.refine.light import SCALES, exposed
from activestereo.diagnose.refine.normal_equations import Cluster, Pixels, cluster_of
from activestereo.effects import Model

# The linear model uses so many pixels, and the first fit so many Gauss-Newton steps.
_LOOKED_AT, _ROUNDS = 200_000, 3
_SEED = 11
Columns = NDArray[np.float32]


def some_pixels(observations: Sequence[Observation], seed: int = 0) -> tuple[Observation, ...]:
    """Returns the observations with a random part of their pixels, as many as fits need. All images of one view use the
    same pixels, so that their light is computed once."""
    share = min(1.0, _LOOKED_AT / max(sum(o.pixels for o in observations), 1))
    views: dict[Cluster, int] = {}
    out = []
    for o in observations:
        number = views.setdefault(cluster_of(o), len(views))
        rng = np.random.Generator(np.random.PCG64([_SEED, seed, number]))
        pool = np.arange(o.measured.size) if o.pick is None else o.pick
        out.append(replace(o, pick=np.sort(rng.permutation(pool)[: max(1, round(share * len(pool)))])))
    return tuple(out)


@dataclass(frozen=True)
class Linear:
    """The linear model at a solution, over the fitter's pixels [n] of all observations in a row.

    nuisances: [k][n], derivatives by the parameters of the effects named so far, then scales, focal lengths, albedos
    and geometry, in noise deviations per unit. precision, pull: of their priors. residual: [n], in noise deviations.
    material: the scene's surface at each pixel. block: the image block of each pixel, shared by repeats, whose errors
    vary together.
    """

    fitter: Fitter
    solution: Solution
    nuisances: Columns
    precision: NDArray[np.float64]
    pull: NDArray[np.float64]
    residual: Columns
    material: NDArray[np.int64]
    block: NDArray[np.int64]

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
    surface = [p.gather(_surface(p.observation)) for p in pixels]
    return Linear(fitter, solution, A, prior, pull, residual, np.concatenate(surface), _blocks(pixels))


def fitted_model(fitter: Fitter, model: Model, phi: NDArray[np.float64]) -> Solution:
    """Fits a model and the nuisances, starting from the model's parameters and phi."""
    space = ParameterSpace.of(model)
    return fitter.refine(space, space.start, phi, _ROUNDS)


def _surface(o: Observation) -> NDArray[np.int64]:
    material = o.view.material
    return np.zeros(o.view.shape, np.int64) if material is None else np.asarray(material).astype(np.int64)


def _blocks(pixels: Sequence[Pixels]) -> NDArray[np.int64]:
    """Returns the number of each pixel's image block: blocks of one camera's images of one pose, temperature and
    motion."""
    out: list[NDArray[np.int64]] = []
    known: dict[tuple[object, ...], int] = {}
    first = 0
    for p in pixels:
        key, block = (*cluster_of(p.observation), p.observation.frame.temperature_c), p.block()
        if key not in known:
            known[key] = first
            first += int(p.observation.measured.size)  # more than there are blocks
        out.append(block + known[key])
    return np.asarray(np.unique(np.concatenate(out), return_inverse=True)[1], dtype=np.int64)
