# SPDX-License-Identifier: Apache-2.0
"""Fits of a model with nothing added; one model is fitted once."""

from collections.abc import Hashable

import numpy as np

from activestereo.diagnose.evidence import Evidence
from activestereo.diagnose.findings import BaseFit
from activestereo.diagnose.refine import Fitters, ParameterSpace
from activestereo.diagnose.score.likelihood import cross_validated
from activestereo.diagnose.score.whiteness import white_rest
from activestereo.diagnose.thresholds import Thresholds
from activestereo.effects import Model

_ITERATIONS = 6


def fit_base(
    evidence: Evidence, fitters: Fitters, model: Model, thresholds: Thresholds, phi: np.ndarray | None = None
) -> BaseFit:
    """The BaseFit of a model. phi: nuisances to start from, of a fit near by."""
    space = ParameterSpace.of(model)
    start = fitters.train.phi0(evidence.nuisances) if phi is None else phi
    solution = fitters.train.refine(space, space.start, start, _ITERATIONS)
    train, test = (tuple(f.residuals(solution)) for f in (fitters.train, fitters.test))
    chi2 = cross_validated(fitters.train, solution)
    return BaseFit(model, solution, chi2, solution.sums.tile_chi2, train, test, white_rest(train, thresholds))


class BaseFits:
    """The BaseFit of any model, remembered by the model."""

    def __init__(self, evidence: Evidence, fitters: Fitters, thresholds: Thresholds) -> None:
        self._evidence, self._fitters, self._thresholds = evidence, fitters, thresholds
        self._known: dict[Hashable, BaseFit] = {}

    def __call__(self, model: Model, phi: np.ndarray | None = None) -> BaseFit:
        key = tuple((e.id, tuple(values.items())) for e, values in model.effects)
        if key not in self._known:
            self._known[key] = fit_base(self._evidence, self._fitters, model, self._thresholds, phi)
        return self._known[key]
