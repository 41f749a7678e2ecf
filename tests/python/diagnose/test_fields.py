# SPDX-License-Identifier: Apache-2.0
"""Random fields that one frame predicts for another, and the structure that a residual still holds."""

from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.diagnose.fields import field_parameters, fit_fields, has_extended_draws, imitates, level_means
from activestereo.diagnose.fitter import ImageResidual
from activestereo.diagnose.goodness import local_structure
from activestereo.diagnose.numbers import NUMBERS
from activestereo.diagnose.outcome import Name
from activestereo.diagnose.search import Search
from activestereo.effects import builtin

FIELD_SHAPE = (60, 80)
FIELD_NOISE_DN, HOT_DN, HOT_SHARE = 2.0, 20.0, 0.01
EXPOSURES_S = 4e-3, 4e-3, 2e-3, 4e-3
SHAPE = (96, 160)
NOISE_DN = 2.0


def observed(shape, noise_dn, **fields):
    """As much of an Observation as fields and structure look at."""
    view = SimpleNamespace(once=lambda *_: np.zeros(shape, bool), max_dn=255)
    return SimpleNamespace(side="left", weight=np.full(shape, noise_dn**-2), view=view, **fields)


def rows_with(pattern_dn, hot_dn):
    """Residuals of four poses of one camera."""
    rng = np.random.default_rng(5)
    pattern = pattern_dn * rng.standard_normal(FIELD_SHAPE)
    hot = hot_dn * rng.standard_exponential(FIELD_SHAPE) * (rng.random(FIELD_SHAPE) < HOT_SHARE)
    rows = []
    for pose, exposure_s in enumerate(EXPOSURES_S):
        still = {"projector_power": 1.0, "camera_to_world": np.eye(4) + pose, "is_moving": False}
        frame = SimpleNamespace(id=pose, exposure_gain=exposure_s, **still)
        o = observed(FIELD_SHAPE, FIELD_NOISE_DN, key=(pose, "left"), frame=frame, measured=np.zeros(FIELD_SHAPE))
        residual = pattern + hot * exposure_s / EXPOSURES_S[0] + FIELD_NOISE_DN * rng.standard_normal(FIELD_SHAPE)
        rows.append(ImageResidual(o, np.full(FIELD_SHAPE, 60.0), np.full(FIELD_SHAPE, 40.0), residual))
    return tuple(rows)


def fitted(effect, rows):
    return fit_fields(effect, rows, [level_means(row) for row in rows], 0.0, NUMBERS)


@pytest.mark.parametrize("pattern_dn", [0.0, 2.0])
def test_hot_pixels_are_found_with_their_share(pattern_dn):
    effect, rows = builtin()["hot_pixels"], rows_with(pattern_dn, HOT_DN)
    fit = fitted(effect, rows)
    found = field_parameters(effect, fit)
    assert found["share"].value == pytest.approx(HOT_SHARE, rel=0.5)
    assert found["rate_dn_per_s"].low < HOT_DN / EXPOSURES_S[0] < found["rate_dn_per_s"].high
    before, after = (sum((r**2).sum() for r in images) for images in ([row.residual for row in rows], fit.residuals))
    assert after < 0.9 * before
    none = fitted(effect, rows_with(pattern_dn, 0.0))
    assert none is None or none.share < 0.1 * HOT_SHARE


def test_offsets_of_all_pixels_leave_hot_ones_to_be_found():
    rows = rows_with(2.0, HOT_DN)
    offsets = fitted(builtin()["fixed_pattern_noise"], rows)
    left = [r._replace(residual=x) for r, x in zip(rows, offsets.residuals, strict=True)]
    assert fitted(builtin()["hot_pixels"], left).share > 0.25 * HOT_SHARE


def drawn_again(effect, rows, drawn):
    """(the names of a search that took the draws `drawn` off the rows, the field that it takes off in their place)."""
    fields = []
    search = SimpleNamespace(
        _names=[Name(effect, {effect.id: 1.0}, 1.0, field=object())],
        _draws={effect.id: drawn},
        _rows=[row._replace(residual=row.residual - drawn[row.observation.key]) for row in rows],
        _solution=SimpleNamespace(nuisances=SimpleNamespace(black_dn=0.0)),
        _numbers=NUMBERS,
        _needless=set(),
        _chi2=1.0,
        _pixels=1,
        _take_draws=lambda name, rows, field: fields.append(field),
    )
    Search._draw_again(search)
    return search._names, fields[0]


def test_draws_are_estimated_again_once_what_hid_them_is_named():
    """An error of one frame, such as of a late shutter, had been taken for draws of all others."""
    effect, rows = builtin()["hot_pixels"], rows_with(0.0, HOT_DN)
    late = [r._replace(residual=r.residual + 8.0 * np.sin(np.arange(FIELD_SHAPE[1]))) for r in rows[:1]] + [*rows[1:]]
    hidden = fitted(effect, late)
    drawn = {r.observation.key: r.residual - x for r, x in zip(late, hidden.residuals, strict=True)}
    names, field = drawn_again(effect, rows, drawn)
    share, before = (sum((r**2).sum() for r in x) for x in (fitted(effect, rows).residuals, hidden.residuals))
    assert field.share == pytest.approx(fitted(effect, rows).share) and share < 0.9 * before
    assert [n.field for n in names] == [field] and names[0].gain > 0.0
    none = rows_with(0.0, 0.0)
    assert drawn_again(effect, none, {r.observation.key: np.ones(FIELD_SHAPE) for r in none})[0] == []


def test_only_the_freer_field_imitates_the_other():
    """Offsets of all pixels can hold hot ones' charge, and one view's grains the gains of pixels that last."""
    for free, bound in (("fixed_pattern_noise", "hot_pixels"), ("speckle_static", "prnu")):
        assert imitates(builtin()[free], builtin()[bound])
        assert not imitates(builtin()[bound], builtin()[free])
    assert not imitates(builtin()["prnu"], builtin()["fixed_pattern_noise"])


def test_gains_of_every_second_column_are_no_random_draws():
    """As crosstalk between columns gives them; random ones are found."""
    rng, random = np.random.default_rng(8), rows_with(0.0, 0.0)
    gains = 0.1 * rng.standard_normal(FIELD_SHAPE), 0.1 * np.broadcast_to((-1.0) ** np.arange(80), FIELD_SHAPE)
    found = []
    for gain in gains:
        rows = tuple(row._replace(residual=row.residual + gain * row.expected) for row in random)
        found.append(fitted(builtin()["prnu"], rows))
    assert found[0].sigma["sigma"] == pytest.approx(0.1, rel=0.1) and found[1] is None


def test_an_error_of_the_tone_curve_is_no_grain():
    """It is alike wherever the dots are as bright, so that static dots would predict each other's."""
    rng = np.random.default_rng(6)
    rows, share = rows_with(0.0, 0.0), {}
    dots = 20.0 + 100.0 * rng.random(FIELD_SHAPE)
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


def dots(rng):
    """An image of smoothed random dots on a ramp, DN."""
    image = np.kron(rng.random((SHAPE[0] // 4, SHAPE[1] // 4)) > 0.7, np.ones((4, 4))) * 80.0
    for axis in (0, 1):
        image = (np.roll(image, 1, axis) + 2 * image + np.roll(image, -1, axis)) / 4
    return 20.0 + image + np.linspace(0, 10, SHAPE[1])


def row(image, residual):
    o = observed(SHAPE, NOISE_DN, frame=SimpleNamespace(), pixels=image.size)
    return ImageResidual(o, image, image - 20.0, residual)


def test_noise_and_grains_are_no_structure():
    rng = np.random.default_rng(3)
    for _ in range(3):
        image = dots(rng)
        noise = NOISE_DN * rng.standard_normal(SHAPE)
        assert abs(local_structure([row(image, noise)])) < 0.01
        grains = 0.2 * image * rng.standard_normal(SHAPE)
        assert abs(local_structure([row(image, noise + grains)])) < 0.03 * np.mean(grains**2) / NOISE_DN**2


@pytest.mark.parametrize("kind", ["displaced", "brighter", "offset", "blurred"])
def test_what_moves_dims_or_blurs_smoothly_is_structure_of_its_own_size(kind):
    rng = np.random.default_rng(4)
    image = dots(rng)
    across = np.linspace(-1.0, 1.0, SHAPE[1])
    change = {
        "displaced": 0.2 * across * np.gradient(image)[1],
        "brighter": 0.08 * across * image,
        "offset": 3.0 * across * np.ones(SHAPE),
        "blurred": 0.1 * (1.0 + across) * sum(np.gradient(np.gradient(image)[axis])[axis] for axis in (0, 1)),
    }[kind]
    size = np.mean(change**2) / NOISE_DN**2
    structure = local_structure([row(image, change + NOISE_DN * rng.standard_normal(SHAPE))])
    assert (0.5 if kind == "blurred" else 0.8) * size < structure < 1.1 * size


def test_an_edge_in_one_corner_of_a_dark_picture_makes_no_structure_of_noise():
    image = np.full(SHAPE, 6.0)
    image[4::16, 4::16] += 0.02  # one half of each tile has an edge, of which the other hardly shows anything
    image[2::16, 1::16] += 8.0
    noise = NOISE_DN * np.random.default_rng(7).standard_normal((20, *SHAPE))
    assert max(abs(local_structure([row(image, residual)])) for residual in noise) < 0.05
