"""On which surfaces an effect shows: of each material, whether its pixels are explained better with the effect than by another albedo."""

import numpy as np

from activestereo.effects.core.surfaces import MOST_MATERIALS
from activestereo.lab.diagnose_data import ALBEDO_SIGMA
from activestereo.lab.diagnose_fit import signal
from activestereo.lab.diagnose_light import SCALES

# Less than this share of a material's chi2 is no evidence that it shows the effect.
_WORTH_SHARE = 0.01


def explained_surfaces(fitter, play, theta, phi):
    """The effect's `surfaces`: bits of the materials that fit better with the effect of theta than without it, each with an
    albedo of its own; 0 where that is all of them, or none."""
    everywhere, nowhere = theta.copy(), play.start.copy()
    everywhere[play.given] = 0.0
    models, gains, squares = [play.model(everywhere), play.model(nowhere)], np.zeros(MOST_MATERIALS), np.zeros(MOST_MATERIALS)
    sums = [[_Sums() for _ in range(MOST_MATERIALS)] for _ in models]
    for o, *lights in zip(fitter.observations, fitter.lights(play, everywhere), fitter.lights(play, nowhere), strict=True):
        pick = slice(None) if o.pick is None else o.pick
        material = o.view.material.ravel()[pick]
        for part, model, light in zip(sums, models, lights, strict=True):
            image = signal(model, o, light, phi)
            rest, weight, glow = (o.measured - image).ravel()[pick], o.weight.ravel()[pick], (image - phi[SCALES - 1]).ravel()[pick]
            for k in np.unique(material[material < MOST_MATERIALS]):
                part[k].add(*(x[material == k] for x in (rest, glow, weight)))
    for k in range(MOST_MATERIALS):
        squares[k] = sums[1][k].chi2()
        gains[k] = squares[k] - sums[0][k].chi2()
    seen, showing = squares > 0, gains > _WORTH_SHARE * squares
    if not (seen & ~showing).any():
        return 0.0
    return float(sum(2**k for k in np.flatnonzero(seen & showing)))


def on_explained(fitter, solution, steps):
    """The Solution, or one on the surfaces that its own parameters explain, where that is better."""
    if not solution.play.given.any():
        return solution
    theta = solution.theta.copy()
    theta[solution.play.given] = explained_surfaces(fitter, solution.play, theta, solution.phi)
    if (theta == solution.theta).all():
        return solution
    other = fitter.refine(solution.play, theta, solution.phi, steps)
    return other if other.sums.total < solution.sums.total else solution


class _Sums:
    """Of one material: chi2 with its albedo fitted."""

    def __init__(self):
        self._square = self._cross = self._slope = 0.0

    def add(self, rest, glow, weight):
        self._square += float(weight @ rest**2)
        self._cross += float(weight @ (rest * glow))
        self._slope += float(weight @ glow**2)

    def chi2(self):
        return self._square - self._cross**2 / (self._slope + ALBEDO_SIGMA**-2) if self._slope > 0 else 0.0
