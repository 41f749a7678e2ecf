# SPDX-License-Identifier: Apache-2.0
"""The shape of an error is the one that was made, and sentences on it say where it lies."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from activestereo.compare.image_errors import error_shape
from activestereo.report.summary import what_is_missed

HEIGHT, WIDTH, NOISE_DN = 160, 240, 1.0


def _dots():
    rng = np.random.default_rng(5)
    image = np.zeros((HEIGHT, WIDTH))
    image[rng.integers(0, HEIGHT, 900), rng.integers(0, WIDTH, 900)] = 900.0
    return 20.0 + gaussian_filter(image, 1.2)


def _vignetted(image):
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    radius = np.hypot(u / WIDTH - 0.5, v / HEIGHT - 0.5)
    return image * (1.0 - 0.6 * radius**2)


def _weaker(image):
    smooth = gaussian_filter(image, 6.0)
    return smooth + 0.8 * (image - smooth)


@pytest.mark.parametrize(
    "kind, sign, change",
    [
        ("brightness", -1, _vignetted),
        ("dots", -1, _weaker),
        ("sharpness", 1, lambda image: gaussian_filter(image, 0.6)),
        ("place", 1, lambda image: shift(image, (0.1, 0.25), mode="nearest")),
    ],
)
def test_each_error_has_the_shape_that_was_made(kind, sign, change):
    expected, rng = _dots(), np.random.default_rng(1)
    measured = change(expected) + rng.normal(0.0, NOISE_DN, expected.shape)
    shape = error_shape([(measured, expected, NOISE_DN**2, np.ones(measured.shape, bool))])
    assert shape.kind == kind and np.sign(shape.amount) == sign and shape.share > 0.5
    if kind == "place":
        assert shape.amount == pytest.approx(np.hypot(0.1, 0.25), rel=0.3)  # dots of 1.2 px: differences are too flat
    if kind == "dots":
        assert shape.amount == pytest.approx(-0.2, abs=0.02)
    if kind == "sharpness":  # a blur of sigma adds sigma² / 2 of the Laplacian (heat equation)
        assert shape.amount == pytest.approx(0.18, rel=0.25)


def test_noise_alone_has_no_shape_and_unknown_pixels_count_nowhere():
    expected, rng = _dots(), np.random.default_rng(1)
    measured = expected + rng.normal(0.0, NOISE_DN, expected.shape)
    wrong = np.where(np.arange(WIDTH) < 100, measured + 50.0, measured)
    known = np.broadcast_to(np.arange(WIDTH) >= 100, expected.shape)
    for image, mask in ((measured, np.ones_like(known)), (wrong, known)):
        shape = error_shape([(image, expected, NOISE_DN**2, mask)])
        assert shape is None or shape.kind == "other"


def _table(covariate, bins):
    rows = [{"low": a, "high": b, "pixels": n, "excess": e, "mean": -e} for a, b, n, e in bins]
    return {"channel": "infrared", "covariate": covariate, "is_finding": True, "concentration": 0.5, "bins": rows,
            "mean_share": 0.0}  # fmt: skip


def _scores(**changed):
    table = _table("radius", [(0.0, 0.5, 600, 0.0), (0.5, 0.75, 300, 1.0), (0.75, 1.0, 100, 27.0)])
    return {
        "warnings": [], "shape": {"kind": "brightness", "share": 0.9, "amount": -2.0}, "where": [table],
        "channels": {"infrared": {"is_explainable": True}}, "without_effects": None,
        "ir": {"test": {"rmse_dn": 2.08, "noise_floor_dn": 1.5}}, "depth": {"test": {"rmse_px": 3.047}},
    } | changed  # fmt: skip


@pytest.mark.parametrize("floor_dn, little", [(2.0, True), (1.9, False), (None, False)])
def test_an_error_that_is_nearly_noise_is_called_little(floor_dn, little):
    said = what_is_missed(_scores(ir={"test": {"rmse_dn": 2.08, "noise_floor_dn": floor_dn}}))
    assert said[0].startswith("Little is missing") == little
    assert any("of the small rest lies" in sentence for sentence in said) == little


def test_the_sentence_says_what_where_and_which_families():
    first, second = what_is_missed(_scores())
    assert first == (
        "The measured images are smoothly darker than the model's: 90 % of the error lies beyond 0.75 of the way to "
        "the corners, in 10 % of the pixels."
    )
    assert second.startswith("Effects that do this: lens shading, projector shading.")
    assert what_is_missed(_scores(warnings=["swapped"]))[0] == "Warning: swapped."
    at_the_floor = {"infrared": {"is_explainable": False}}
    assert "noise floor" in what_is_missed(_scores(channels=at_the_floor))[0]


def test_an_error_that_changes_its_sign_is_told_on_both_sides():
    table = _table("radius", [(0.0, 0.3, 300, 20.0), (0.3, 0.6, 300, 2.0), (0.6, 1.0, 400, 20.0)])
    for row, mean in zip(table["bins"], (4.0, 1.0, -4.0), strict=True):
        row["mean"] = mean
    depth = _table("depth", [(1.0, 2.0, 400, 30.0), (2.0, 3.0, 600, 2.0)])
    said = what_is_missed(_scores(where=[depth, table | {"mean_share": 0.86}]))
    assert said[0] == (
        "The measured images are smoothly brighter than the model's within 0.6 of the way to the corners and darker "
        "beyond: 86 % of the error."
    )
    assert said[1].startswith("Effects that do this: lens shading, projector shading.")


def test_materials_are_told_only_of_errors_that_depend_on_them():
    radius = _table("radius", [(0.0, 0.6, 600, 1.0), (0.6, 1.0, 400, 9.0)])
    material = _table("material", [(None, None, 900, 0.0), (None, None, 100, 50.0)])
    for name, row in zip(("wall", "stripes"), material["bins"], strict=True):
        row["label"] = name
    for kind, words in (("dots", "lies on stripes"), ("place", "lies beyond 0.6 of the way to the corners")):
        shape = {"kind": kind, "share": 0.9, "amount": 0.3}
        assert words in what_is_missed(_scores(shape=shape, where=[radius, material]))[0]


@pytest.mark.parametrize("before_px, differ", [(2.919, True), (4.0, False), (None, False)])
def test_infrared_that_improves_without_depth_is_told(before_px, differ):
    said = what_is_missed(_scores(without_effects={"ir": {"test": 5.01}, "depth": {"test": before_px}}))
    assert "goes from 5.01 to 2.08 DN" in " ".join(said)
    assert ("infrared improves and depth does not" in " ".join(said)) == differ
