# SPDX-License-Identifier: Apache-2.0
"""Random fields, and what only looks like one: the error of a tone curve."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.effects import builtin
from activestereo.diagnose.fields import field_parameters, fit_fields, has_extended_draws, level_means
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.fitter import ImageResidual

SHAPE = (60, 80)
NOISE_DN, HOT_DN, HOT_SHARE = 2.0, 20.0, 0.01
EXPOSURES_S = 4e-3, 4e-3, 2e-3, 4e-3


def rows_with(pattern_dn, hot_dn):
    """Residuals of four poses of one camera."""
    rng = np.random.default_rng(5)
    pattern = pattern_dn * rng.standard_normal(SHAPE)
    hot = hot_dn * rng.standard_exponential(SHAPE) * (rng.random(SHAPE) < HOT_SHARE)
    rows = []
    for pose, exposure_s in enumerate(EXPOSURES_S):
        frame = SimpleNamespace(id=pose, exposure_gain=exposure_s, camera_to_world=np.eye(4) + pose, is_moving=False)
        o = SimpleNamespace(
            side="left",
            frame=frame,
            measured=np.zeros(SHAPE),
            weight=np.full(SHAPE, NOISE_DN**-2),
            view=SimpleNamespace(once=lambda *_: np.zeros(SHAPE, bool), max_dn=255),
        )
        residual = pattern + hot * exposure_s / EXPOSURES_S[0] + NOISE_DN * rng.standard_normal(SHAPE)
        rows.append(ImageResidual(o, np.full(SHAPE, 60.0), np.full(SHAPE, 40.0), residual))
    return tuple(rows)


def fitted(effect, rows):
    return fit_fields(effect, rows, [level_means(row) for row in rows], 0.0, NUMBERS)


@pytest.mark.parametrize("pattern_dn", [0.0, 2.0])
def test_hot_pixels_are_found_with_their_share(pattern_dn):
    effect, rows = builtin()["hot_pixels"], rows_with(pattern_dn, HOT_DN)
    fit = fitted(effect, rows)
    assert 0.3 * HOT_SHARE < field_parameters(effect, fit)["share"].value < 1.1 * HOT_SHARE
    before, after = (sum((r**2).sum() for r in images) for images in ([row.residual for row in rows], fit.residuals))
    assert after < 0.9 * before
    none = fitted(effect, rows_with(pattern_dn, 0.0))
    assert none is None or none.share < 0.1 * HOT_SHARE


def test_an_error_of_the_tone_curve_is_no_grain():
    """It is alike wherever the dots are as bright, so that static dots would predict each other's."""
    rng = np.random.default_rng(6)
    rows, share = rows_with(0.0, 0.0), {}
    dots = 20.0 + 100.0 * rng.random(SHAPE)
    for error in (0.0, 12.0):
        bent = [
            r._replace(expected=dots, projector=dots - 20.0, residual=r.residual + error * np.sin((dots - 20.0) / 16.0))
            for r in rows
        ]
        for name in ("prnu", "fixed_pattern_noise"):
            fit = fitted(builtin()[name], bent)
            left = bent if fit is None else [r._replace(residual=x) for r, x in zip(bent, fit.residuals, strict=True)]
            before, after = (np.mean([r.residual**2 for r in some]) for some in (bent, left))
            share[name, error] = 1.0 - after / before
    assert max(share.values()) < 0.03


@pytest.mark.parametrize(
    ("effect", "extended"), [("fixed_pattern_noise", True), ("dot_gain_spread", True), ("prnu", False)]
)
def test_draws_of_columns_and_dots_are_structure_until_they_are_taken_off(effect, extended):
    assert has_extended_draws(builtin()[effect]) is extended
