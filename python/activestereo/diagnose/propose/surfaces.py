# SPDX-License-Identifier: Apache-2.0
"""On which surfaces an effect shows: of each material, whether its pixels are explained better with the effect
than by another albedo.
"""

import numpy as np

from activestereo.diagnose.refine.fitter import Fitter, signal
from activestereo.diagnose.refine.light import SCALES
from activestereo.diagnose.refine.parameter_space import ParameterSpace, Solution
from activestereo.effects.core.surfaces import MOST_MATERIALS

# Less than this share of a material's chi2 is no evidence that it shows the effect.
_WORTH_SHARE = 0.01


def explained_surfaces(
    fitter: Fitter, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray, without: np.ndarray
) -> float:
    """The effect's `surfaces`: bits of the materials that fit better with the effect of theta than without it,
    each with an albedo of its own; 0 where that is all of them, or none. without: see nowhere().
    """
    everywhere = theta.copy()
    everywhere[space.given] = 0.0
    with_effect = _by_material(fitter, space, everywhere, phi)
    seen, showing = without > 0, without - with_effect > _WORTH_SHARE * without
    if not (seen & ~showing).any():
        return 0.0
    return float(sum(2**k for k in np.flatnonzero(seen & showing)))


def nowhere(fitter: Fitter, space: ParameterSpace, phi: np.ndarray) -> np.ndarray:
    """chi2 of every material where no surface shows the effect."""
    return _by_material(fitter, space, space.start, phi)


def _by_material(fitter: Fitter, space: ParameterSpace, theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """chi2 of every material, each with an albedo of its own."""
    sums, model = [_Sums() for _ in range(MOST_MATERIALS)], space.model(theta)
    for o, light in zip(fitter.observations, fitter.lights(space, theta), strict=True):
        pick = o.picked()
        surfaces = np.zeros(o.view.shape, dtype=np.int64) if o.view.material is None else o.view.material
        material, weight = surfaces.ravel()[pick], o.weight.ravel()[pick]
        image = signal(model, o, light, phi)
        rest, glow = (x.ravel()[pick] for x in (o.measured - image, image - phi[SCALES - 1]))
        for k in np.unique(material[material < MOST_MATERIALS]):
            here = material == k
            sums[k].add(rest[here], glow[here], weight[here])
    return np.array([s.chi2(fitter.albedo_sigma) for s in sums])


def on_explained(fitter: Fitter, solution: Solution, steps: int) -> Solution:
    """The Solution, or one on the surfaces that its own parameters explain, where that is better."""
    if not solution.space.given.any():
        return solution
    theta = solution.theta.copy()
    without = nowhere(fitter, solution.space, solution.phi)
    theta[solution.space.given] = explained_surfaces(fitter, solution.space, theta, solution.phi, without)
    if (theta == solution.theta).all():
        return solution
    other = fitter.refine(solution.space, theta, solution.phi, steps)
    return other if other.sums.total < solution.sums.total else solution


class _Sums:
    """Sums over one material for chi2 with its albedo fitted."""

    def __init__(self) -> None:
        self._square = self._cross = self._slope = 0.0

    def add(self, rest: np.ndarray, glow: np.ndarray, weight: np.ndarray) -> None:
        self._square += float(weight @ rest**2)
        self._cross += float(weight @ (rest * glow))
        self._slope += float(weight @ glow**2)

    def chi2(self, albedo_sigma: float) -> float:
        return self._square - self._cross**2 / (self._slope + albedo_sigma**-2) if self._slope > 0 else 0.0
