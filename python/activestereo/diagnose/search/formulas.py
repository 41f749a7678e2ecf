# SPDX-License-Identifier: Apache-2.0
"""The freedom of formulas: what the formula of a named effect misses looks like the effect itself, weighed by place or
by brightness, and is not another effect's."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.refine import Solution
from activestereo.diagnose.refine.light import exposed
from activestereo.diagnose.search.linear import Columns, Linear
from activestereo.diagnose.search.scores import scores
from activestereo.effects import Effect, Model


def freed(linear: Linear, effects: Iterable[Effect], share: float) -> Linear:
    """The linear model with nuisances for the formulas of effects in it: their changes, weighed by the square of the
    distance from the image's centre, and by brightness. share: of the squared change, that each may be."""
    here = _images(linear, linear.solution.model)
    fields = [p.observation.view.field() for p in linear.fitter.pixels()]
    radii = [p.of(np.asarray(u**2 + v**2)) for p, (u, v) in zip(linear.fitter.pixels(), fields, strict=True)]
    weights = [np.concatenate(by) for by in (radii, here)]
    rows = [_change(linear, here, linear.solution.model.without_effect(e.id)) for e in effects]
    added = [row * standard for row in rows for weight in weights if (standard := _standard(weight, row)) is not None]
    if not added:
        return linear
    return replace(
        linear,
        nuisances=np.concatenate([linear.nuisances, np.stack(added).astype(np.float32)]),
        precision=np.concatenate([linear.precision, np.full(len(added), 1.0 / share)]),
        pull=np.concatenate([linear.pull, np.zeros(len(added))]),
    )


def gain_beyond(linear: Linear, fit: Solution) -> float:
    """The fall of chi2 by what a fit changes, beyond all nuisances of a linear model."""
    left = linear.fitter.residuals(fit)
    pairs = zip(linear.fitter.pixels(), left, strict=True)
    change = linear.residual - np.concatenate([p.of(row.residual) * p.root_weight for p, row in pairs])
    information, score, _ = scores(linear, change[None].astype(np.float32)).of(slice(0, 1))
    return float(score[0] ** 2 / max(information[0, 0], 1e-9))


def _images(linear: Linear, model: Model) -> list[NDArray[np.float64]]:
    pixels, phi = enumerate(linear.fitter.pixels()), linear.solution.phi
    return [exposed(model, p, linear.fitter.light(model, i), phi)[0] for i, p in pixels]


def _change(linear: Linear, here: list[NDArray[np.float64]], model: Model) -> Columns:
    """By how much the images differ from a model's, noise units [n]."""
    triples = zip(linear.fitter.pixels(), here, _images(linear, model), strict=True)
    return np.concatenate([((image - other) * p.root_weight).astype(np.float32) for p, image, other in triples])


def _standard(weight: NDArray[np.float64], change: Columns) -> NDArray[np.float64] | None:
    """A weight of mean 0 and deviation 1 over the squared change; None where it is the same everywhere."""
    square = change.astype(np.float64) ** 2
    total = max(float(square.sum()), 1e-12)
    away = weight - float(weight @ square) / total
    deviation = np.sqrt(float(away**2 @ square) / total)
    return away / deviation if deviation > 1e-6 * max(np.abs(weight).max(), 1e-12) else None
