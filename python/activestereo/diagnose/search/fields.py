# SPDX-License-Identifier: Apache-2.0
"""Random fields that stay (gains of pixels, dots or rows, speckle): variance components of what images leave."""

from collections.abc import Iterable, Sequence

from activestereo.diagnose.channels.field_fit import fit_fields
from activestereo.diagnose.findings import FieldFit
from activestereo.diagnose.refine import ImageResidual
from activestereo.diagnose.score.whiteness import white_rest
from activestereo.diagnose.thresholds import THRESHOLDS
from activestereo.effects import Effect
from activestereo.effects.core.judging import Channel, SharedBy


def fields_of(
    effects: Iterable[Effect], rows: Sequence[ImageResidual], black_dn: float
) -> dict[str, tuple[float, FieldFit]]:
    """{effect: (share of chi2 that its draws explain, its fit)} of effects whose draws other frames predict. Draws that
    last while the rig stands are white over the image."""
    whole, is_white, out = _chi2(rows), white_rest(rows, THRESHOLDS) > 0.0, {}
    for effect in effects:
        lasts_a_view = any(term.shared_by is SharedBy.VIEW for term in effect.random_terms)
        if effect.channel is not Channel.STATIC_FIELD or (lasts_a_view and not is_white):
            continue
        fit = fit_fields(effect, rows, black_dn, THRESHOLDS)
        if fit is not None:
            left = [row._replace(residual=residual) for row, residual in zip(rows, fit.residuals, strict=True)]
            out[effect.id] = 1.0 - _chi2(left) / whole, fit
    return out


def _chi2(rows: Sequence[ImageResidual]) -> float:
    return float(sum((row.observation.weight * row.residual**2).sum() for row in rows))
