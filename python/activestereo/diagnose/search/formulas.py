# SPDX-License-Identifier: Apache-2.0
"""Allows for errors of formulas: the residual that a named effect's formula leaves is not another effect.

Such a residual looks like the effect itself, weighed by place or by brightness, or like its smooth part (glare that
fades with distance).
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.refine import Solution
from activestereo.diagnose.search.dictionary import Atom
from activestereo.diagnose.search.linear import Columns, Linear
from activestereo.diagnose.search.scores import scores
from activestereo.diagnose.search.selection import candidates
from activestereo.effects import Effect


def freed(linear: Linear, effects: Iterable[Effect], share: float) -> Linear:
    """Returns the linear model with extra nuisances that absorb the error of each named effect's formula. They are the
    effect's image change times place, times squared distance from the image centre, times brightness, and averaged
    over tiles. share: prior variance of each coefficient."""
    model = linear.solution.model
    here = linear.images(model)
    fields = [(p, *p.observation.view.field()) for p in linear.fitter.pixels()]
    places = ([p.gather(np.asarray(by)) for by in (u, v, u**2 + v**2)] for p, u, v in fields)
    weights = [np.concatenate(by) for by in (*zip(*places, strict=True), here)]
    rows = [-linear.change(model.without_effect(e.id), here) for e in effects]
    added = [row * standard for row in rows for weight in weights if (standard := _standard(weight, row)) is not None]
    added += [_smooth(linear, row) for row in rows]
    if not added:
        return linear
    return replace(
        linear,
        nuisances=np.concatenate([linear.nuisances, np.stack(added).astype(np.float32)]),
        precision=np.concatenate([linear.precision, np.full(len(added), 1.0 / share)]),
        pull=np.concatenate([linear.pull, np.zeros(len(added))]),
    )


def gain_beyond(linear: Linear, fit: Solution) -> float:
    """Returns the fall of chi2 by a fit's image change, counting only the part that no nuisance of the linear model can
    imitate."""
    left = linear.fitter.residuals(fit)
    pairs = zip(linear.fitter.pixels(), left, strict=True)
    change = linear.residual - np.concatenate([p.gather(row.residual) * p.root_weight for p, row in pairs])
    information, score, _ = scores(linear, change[None].astype(np.float32)).select(slice(0, 1))
    return float(score[0] ** 2 / max(information[0, 0], 1e-9))


def stand_ins(
    linear: Linear, effect: Effect, atoms: Sequence[Atom], columns: Columns, floor: float, numbers: Numbers
) -> list[str]:
    """Returns the ids of other effects that can imitate one parameter's part of a named effect: what an amplitude adds,
    or a change of a shape by its typical value. A black level that moves with temperature can imitate a dark signal's
    doubling temperature. atoms, columns: the others' trial shapes and image changes. floor: changes with a smaller chi2
    per pixel are ignored."""
    space, model = linear.solution.space, linear.solution.model
    own, values = next((e, values) for e, values in model.effects if e.id == effect.id)
    here, out = linear.images(model), dict[str, None]()
    for i in (i for i, (e, p) in enumerate(space.pairs) if atoms and e.id == effect.id and not p.choice):
        p = space.pairs[i][1]
        usual = values[p.name] + p.typical if p.neutral else 0.0
        usual = usual if usual <= p.high else max(values[p.name] - p.typical, p.low)
        change = linear.change(model.with_effect(own, **values | {p.name: usual}), here)
        rest = {name: np.delete(getattr(linear, name), i, axis=0) for name in ("nuisances", "precision")}
        alone = replace(linear, **rest, pull=np.zeros(len(rest["precision"])), residual=change)
        seen = scores(alone, columns)
        found = candidates(atoms, seen, seen.pixels) if seen.total > floor * seen.pixels else {}
        out |= dict.fromkeys(name for name, c in found.items() if c.gain > (1.0 - numbers.formula_error) * seen.total)
    return list(out)


def _smooth(linear: Linear, row: Columns) -> Columns:
    """Returns a change's means over tiles, scaled to be as large as the change itself."""
    pixels = linear.fitter.pixels()
    tile, root = (np.concatenate(x) for x in ([p.tile for p in pixels], [p.root_weight for p in pixels]))
    mean = np.bincount(tile, row / np.maximum(root, 1e-12)) / np.maximum(np.bincount(tile), 1)
    smooth = mean[tile] * root
    return np.asarray(smooth * np.sqrt(float(row @ row) / max(float(smooth @ smooth), 1e-12)), np.float32)


def _standard(weight: NDArray[np.float64], change: Columns) -> NDArray[np.float64] | None:
    """Returns a weight scaled to mean 0 and deviation 1 over the squared change; None if it is constant."""
    square = change.astype(np.float64) ** 2
    total = max(float(square.sum()), 1e-12)
    away = weight - float(weight @ square) / total
    deviation = np.sqrt(float(away**2 @ square) / total)
    return away / deviation if deviation > 1e-6 * max(np.abs(weight).max(), 1e-12) else None
