# SPDX-License-Identifier: Apache-2.0
"""The few likely effects are fitted beside the model: from where the line leads, and from points of the dictionary."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from activestereo.diagnose.refine import Fitter, ParameterSpace, Solution
from activestereo.diagnose.search.rendered import Rendering, fitted_to_renders, is_transport
from activestereo.diagnose.search.selection import Candidate
from activestereo.effects import Effect, Model
from activestereo.effects.core.differences import known_differences

# Fits have so many steps; those that come within this part of the best have more; the start is the best of all, the
# fit the best of two.
_STEPS, _MORE, _CLOSE, _FITTED = 4, 8, 0.85, 2
# An effect whose formula was never measured may miss this share of its squared signature.
_UNMEASURED = 1.0 / 3.0


@dataclass(frozen=True)
class Refit:
    """A fit of an effect beside a model. rendered: whether the engine's images of the effect took its formula's
    place."""

    solution: Solution
    rendered: bool = False

    @property
    def chi2(self) -> float:
        return self.solution.sums.total


def refits(
    fitter: Fitter,
    model: Model,
    phi: np.ndarray,
    chosen: Sequence[Candidate],
    base_chi2: float,
    rendering: Rendering | None,
    workers: int,
) -> dict[str, Refit]:
    """{effect: Refit} of candidates beside a model whose own fit leaves base_chi2."""
    effects = [c.best.atom.effect for c in chosen]
    starts = {c.best.atom.effect.id: c.starts for c in chosen}

    def fit(effect: Effect) -> Solution:
        return _from_starts(fitter, ParameterSpace.of(model, effect), effect, starts[effect.id], phi)

    if fitter.memory is not None:
        fitter.memory.make_ahead(fit, effects, workers)
    found = {effect.id: Refit(fit(effect)) for effect in effects}
    most = max((base_chi2 - f.chi2 for f in found.values()), default=0.0)
    for name, f in found.items():
        s = f.solution
        if len(found) > 1 and base_chi2 - f.chi2 > _CLOSE * most:
            found[name] = Refit(fitter.refine(s.space, s.theta, s.phi, _MORE))
    most = max((base_chi2 - f.chi2 for f in found.values()), default=0.0)
    for name, f in found.items():
        if rendering is not None and is_transport(f.solution.effects[-1]):
            if base_chi2 - f.chi2 > (1.0 - formula_error(f.solution.effects[-1], _UNMEASURED)) * most:
                rendered = fitted_to_renders(fitter, f.solution, rendering)
                found[name] = Refit(rendered, rendered is not f.solution)
    return found


def formula_error(effect: Effect, otherwise: float) -> float:
    """The share of an effect's squared signature that its formula misses: as measured against the engines, where it
    was."""
    measured = known_differences().get(effect.id)
    return otherwise if measured is None else min(measured**2, _UNMEASURED)


def _from_starts(
    fitter: Fitter, space: ParameterSpace, effect: Effect, starts: Sequence[Mapping[str, float]], phi: np.ndarray
) -> Solution:
    """The best fit from the starts, each looked at once."""
    own = len(space.start) - len(effect.parameters)
    thetas = [np.concatenate([space.start[:own], [start[p.name] for p in effect.parameters]]) for start in starts]
    seen = [fitter.nuisance_fit(space, theta, phi)[1] for theta in thetas]
    chosen = [thetas[k] for k in np.argsort(seen)[:_FITTED]]
    fits = [fitter.refine(space, theta, phi, _STEPS) for theta in chosen]
    return min(fits, key=lambda f: f.sums.total)
