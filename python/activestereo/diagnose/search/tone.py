# SPDX-License-Identifier: Apache-2.0
"""Fits a free response curve beside the formula that found it.

A formula of the response is one family of curves; sensors have others (Grossberg and Nayar 2003, What is the space of
camera response functions?). A residual that depends on a pixel's value alone belongs to the response.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from activestereo.common.computed_once import computed_once
from activestereo.diagnose.refine import Fitter, ParameterSpace, Solution
from activestereo.diagnose.refine.fit_cache import content_key
from activestereo.diagnose.refine.light import SCALES
from activestereo.diagnose.search.linear import linearised
from activestereo.effects import Effect, Stage, View

# Nodes of the piecewise linear curve, evenly spaced in the logarithm of the value; steps of the fit with it.
_NODES, _STEPS = 10, 4


@dataclass(frozen=True)
class _Curve:
    """A response effect followed by a curve that adds `added` DN at signals of `nodes` DN above black, linear
    between."""

    effect: Effect
    nodes: NDArray[np.float64]
    added: NDArray[np.float64]

    def bent(self) -> Effect:
        """Returns the effect with the curve added; neutral parameters change nothing."""
        return replace(self.effect, apply=self._apply)

    @computed_once
    def content(self) -> str:
        """Returns a hash of the curve, for a FitCache."""
        return content_key(self.nodes, self.added)

    def _apply(self, signal: NDArray[np.float64], view: View, **values: float) -> NDArray[np.float64]:
        if values == self.effect.neutral_values:
            return signal
        value = self.effect.apply(signal, view, **values)
        return np.asarray(value + np.interp(value, self.nodes, self.added))


def is_response(effect: Effect) -> bool:
    """Returns whether an effect is a response curve that all pixels share."""
    return effect.stage is Stage.READOUT and effect.is_pointwise


def refit_free_curve(fitter: Fitter, solution: Solution) -> Solution:
    """Adds a free correction curve to the last named effect if it is a response curve, and fits again; other fits are
    returned unchanged."""
    if not solution.effects or not is_response(solution.effects[-1]):
        return solution
    effect = solution.effects[-1]
    linear, own = linearised(fitter, solution), len(solution.theta)
    pixels = fitter.pixels()
    weight = np.concatenate([p.root_weight for p in pixels])
    measured = np.concatenate([p.measured for p in pixels])
    value = measured - linear.residual / np.maximum(weight, 1e-12) - solution.phi[SCALES - 1]
    nodes = np.geomspace(max(np.quantile(value, 0.02), 1.0), pixels[0].observation.view.max_dn, _NODES)
    curve = np.stack([np.interp(value, nodes, row) * weight for row in np.eye(_NODES)]).astype(np.float32)
    columns = np.concatenate([linear.nuisances[own:], curve])
    gram = (columns @ columns.T).astype(np.float64)
    prior = np.concatenate([linear.precision[own:], np.full(_NODES, 1e-3)])
    pull = np.concatenate([linear.pull[own:], np.zeros(_NODES)])
    norm = np.sqrt(np.diag(gram) + prior)
    moment = (columns @ linear.residual - pull) / norm
    step = np.linalg.lstsq((gram + np.diag(prior)) / np.outer(norm, norm), moment, rcond=1e-9)[0] / norm
    bent = _Curve(effect, nodes, step[-_NODES:]).bent()
    values = next(values for e, values in solution.model.effects if e is effect)
    space = ParameterSpace.of(solution.model.with_effect(bent, **values))
    return fitter.refine(space, space.start, solution.phi, _STEPS)
