# SPDX-License-Identifier: Apache-2.0
"""Judges random fields that last (gains of pixels, dots or rows, speckle) by the variance that they explain in
residuals."""

from collections.abc import Iterable, Sequence

import numpy as np

from activestereo.diagnose.channels.draws import pose_key
from activestereo.diagnose.channels.field_fit import FieldFit, fit_fields, level_means
from activestereo.diagnose.evidence.model_discrepancy import edges
from activestereo.diagnose.numbers import Numbers
from activestereo.diagnose.refine import ImageResidual
from activestereo.effects import Effect
from activestereo.effects.core.judging import Channel, SharedBy


def fields_of(
    effects: Iterable[Effect], rows: Sequence[ImageResidual], black_dn: float, numbers: Numbers
) -> dict[str, tuple[float, FieldFit]]:
    """Fits lasting random fields: one random number (a draw) for each pixel, row, column or dot, which other frames
    predict. Returns {effect: (share of chi2 that the predicted draws explain, its fit)}. Fields that last only while
    the rig stands still need residuals that are white over the image."""
    chosen = [effect for effect in effects if effect.channel is Channel.STATIC_FIELD]
    if not chosen:
        return {}
    whole, is_white, out = _chi2(rows), _is_white(rows, numbers.neighbours), {}
    curves = [level_means(row) for row in rows]
    for effect in chosen:
        if not is_white and any(term.shared_by is SharedBy.VIEW for term in effect.random_terms):
            continue
        fit = fit_fields(effect, rows, curves, black_dn, numbers)
        if fit is not None:
            left = [row._replace(residual=residual) for row, residual in zip(rows, fit.residuals, strict=True)]
            out[effect.id] = 1.0 - _chi2(left) / whole, fit
    return out


def _chi2(rows: Sequence[ImageResidual]) -> float:
    return float(sum((row.observation.weight * row.residual**2).sum() for row in rows))


def _is_white(rows: Sequence[ImageResidual], neighbours: float) -> bool:
    """Returns whether the residuals that repeats of a view share are uncorrelated between neighbouring pixels, edges
    left out. Speckle grains are; shifted, dimmed or blurred dots are not. neighbours: the largest correlation
    allowed."""
    by_view: dict[object, list[np.ndarray]] = {}
    for o, _, _, r in rows:
        view = pose_key(o), o.frame.exposure_gain, o.frame.projector_power, o.side
        by_view.setdefault(view, []).append(np.where(edges(o), np.nan, r * np.sqrt(o.weight)))
    same, beside = 0.0, np.zeros(2)
    for first, second, *_ in (group for group in by_view.values() if len(group) > 1):
        same += np.nanmean(first * second)
        beside += [np.nanmean(first[:, 1:] * second[:, :-1]), np.nanmean(first[1:] * second[:-1])]
    return bool(same > 0 and np.abs(beside).max() < neighbours * same)
