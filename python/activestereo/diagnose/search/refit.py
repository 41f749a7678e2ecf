# SPDX-License-Identifier: Apache-2.0
"""Fits the few likely effects beside the model, from starts that their scores and points of the dictionary give."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from activestereo.diagnose.refine import Fitter, ParameterSpace, Solution
from activestereo.diagnose.refine.fit_cache import fit_key
from activestereo.diagnose.search.dictionary import Atom
from activestereo.diagnose.search.rendered import Rendering, fitted_to_renders
from activestereo.diagnose.search.selection import Candidate
from activestereo.effects import Effect, Model, Stage, known_differences

# Fits take a few steps on few images from the best start, and from a second one with this part of its gain, unless the
# first leaves next to nothing. Then fits within this part of the best gain take more steps on all images, until chi2
# hardly falls; the others are only measured there.
_STEPS, _RIVAL, _NOTHING, _MORE, _CLOSE, _TOLERANCE = 2, 0.6, 0.05, 6, 0.75, 1e-3
# An effect whose formula was never measured may miss this share of its squared signature.
_UNMEASURED = 1.0 / 3.0


@dataclass(frozen=True)
class Refit:
    """A fit of an effect beside a model. rendered: whether images that the engine rendered replaced the effect's
    formula."""

    solution: Solution
    rendered: bool = False

    @property
    def chi2(self) -> float:
        return self.solution.sums.total


def refits(
    fitter: Fitter,
    scored: Fitter,
    model: Model,
    phi: np.ndarray,
    chosen: Sequence[Candidate],
    base_chi2: float,
    rendering: Rendering | None,
    workers: int,
) -> dict[str, Refit]:
    """Fits each chosen effect beside a model, one at a time; returns {effect: Refit}. scored: fits few images, for the
    first steps. phi: nuisances to start from. base_chi2: chi2 of the model alone. rendering: renders what changes the
    path of light in place of its formula; None keeps the formulas."""
    starts = {c.best.atom.effect.id: c.starts for c in chosen}
    spaces = [ParameterSpace.of(model, c.best.atom.effect) for c in chosen]
    base = ParameterSpace.of(model)
    base_of_few = scored.nuisance_fit(base, base.start, phi)[1]

    def fit(space: ParameterSpace) -> Solution:
        return _from_starts(scored, space, starts[_name(space)], phi, base_of_few)

    first = _side_by_side(scored, fit, spaces, workers)
    gains = {name: base_of_few - f.chi2 for name, f in first.items()}

    def settled(space: ParameterSpace) -> Solution:
        name = _name(space)
        is_close = gains[name] >= _CLOSE * max(gains.values())
        s = first[name].solution
        return fitter.refine(space, s.theta, s.phi, _MORE if is_close else 0, _TOLERANCE)

    found = _side_by_side(fitter, settled, spaces, workers)
    most = max((base_chi2 - f.chi2 for f in found.values()), default=0.0)
    for name, f in found.items():
        effect = f.solution.effects[-1]
        if rendering is not None and effect.engine is not None and Stage.MEDIUM <= effect.stage <= Stage.SURFACE:
            if base_chi2 - f.chi2 > (1.0 - formula_error(effect, _UNMEASURED)) * most:
                rendered = fitted_to_renders(fitter, f.solution, rendering)
                found[name] = Refit(rendered, rendered is not f.solution)
    return found


def formula_error(effect: Effect, otherwise: float) -> float:
    """Returns the share of an effect's squared signature that its formula misses, as measured against the engines;
    `otherwise` if it was never measured."""
    measured = known_differences().get(effect.id)
    return otherwise if measured is None else min(measured**2, _UNMEASURED)


def _name(space: ParameterSpace) -> str:
    """Returns the id of the effect that is fitted."""
    return space.pairs[-1][0].id


def _side_by_side(
    fitter: Fitter, fit: Callable[[ParameterSpace], Solution], spaces: Sequence[ParameterSpace], workers: int
) -> dict[str, Refit]:
    """Fits every space; returns {effect: Refit}. Fits that the cache can keep are made in `workers` processes."""
    if fitter.memory is not None:
        fitter.memory.make_ahead(fit, [space for space in spaces if fit_key("", space) is not None], workers)
    return {_name(space): Refit(fit(space)) for space in spaces}


def _from_starts(
    fitter: Fitter,
    space: ParameterSpace,
    starts: Sequence[tuple[Atom, Mapping[str, float]]],
    phi: np.ndarray,
    base_chi2: float,
) -> Solution:
    """Fits an effect from several starts and from neutral; returns the best fit. Each start is evaluated once, and only
    the promising ones are fitted: the best and one of another atom, or all good ones of an effect with narrow peaks.
    Each fit begins at the nuisances of its start: far from them a step may fail. base_chi2: chi2 at neutral."""
    effect = space.pairs[-1][0]
    own = len(space.start) - len(effect.parameters)
    thetas = [np.concatenate([space.start[:own], [start[p.name] for p in effect.parameters]]) for _, start in starts]

    def look() -> dict[str, np.ndarray]:
        fits = [fitter.nuisance_fit(space, theta, phi) for theta in thetas]
        return {"phi": np.array([fitted for fitted, _ in fits]), "chi2": np.array([chi2 for _, chi2 in fits])}

    looked = fitter.remembered(look, space, thetas, phi)
    seen, phis = np.append(looked["chi2"], base_chi2), [*looked["phi"], phi]
    thetas, atoms = [*thetas, space.start], [*(atom for atom, _ in starts), None]
    best, *others = np.argsort(seen)
    gain, fit = base_chi2 - seen, fitter.refine(space, thetas[best], phis[best], _STEPS)
    left = fit.sums.total - sum(o.pixels for o in fitter.observations)
    if left < _NOTHING * (base_chi2 - fit.sums.total):
        return fit
    rivals = [k for k in others if gain[k] > _RIVAL * gain[best] and (effect.starts or atoms[k] is not atoms[best])]
    rivals = [fitter.refine(space, thetas[k], phis[k], _STEPS) for k in rivals[: None if effect.starts else 1]]
    return min([fit, *rivals], key=lambda f: f.sums.total)
