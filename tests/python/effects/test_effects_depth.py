# SPDX-License-Identifier: Apache-2.0
"""Matcher effects on disparity, and the model that applies them to a depth image."""

from dataclasses import replace

import numpy as np
import pytest

from activestereo.effects import Model, Stage, builtin
from activestereo.effects.core.laws import example_value, example_view
from activestereo.compare.nuisances import Nuisances

EFFECTS = builtin()


@pytest.fixture
def view():
    return example_view("left")


def plane(view, normal, distance_m):
    """View and disparity of a plane normal . point = -distance_m."""
    x, y = view.rays()
    normal = np.asarray(normal, dtype=np.float64) / np.linalg.norm(normal)
    depth = -distance_m / (normal[0] * x + normal[1] * y + normal[2])
    view = replace(view, depth_m=depth, normal=np.broadcast_to(normal, (*view.shape, 3)))
    return view, view.K[0, 0] * view.baseline_m / depth


def test_pixel_locking_draws_towards_whole_pixels_and_leaves_them_and_halves(view):
    disparity = np.broadcast_to(np.linspace(5.0, 7.0, 801), (3, 801))
    locked = EFFECTS["pixel_locking"](disparity, view, amplitude_px=0.1)
    np.testing.assert_allclose(locked[:, ::200], disparity[:, ::200], atol=1e-12)
    off_whole = lambda d: np.abs(d - np.rint(d)).mean()  # noqa: E731
    assert off_whole(disparity) - off_whole(locked) == pytest.approx(0.1 * 2 / np.pi, rel=0.01)


def test_edge_fattening_moves_a_depth_edge_by_the_radius_onto_the_far_side(view):
    disparity = np.where(np.arange(40) < 20, 10.0, 4.0) * np.ones((30, 1))
    disparity[5, 30] = 0.0
    fat = EFFECTS["edge_fattening"](disparity, view, radius_px=3.0)
    np.testing.assert_array_equal(fat[15], np.where(np.arange(40) < 23, 10.0, 4.0))
    assert fat[5, 30] == 0.0
    partly = EFFECTS["edge_fattening"](disparity, view, radius_px=2.5)
    assert partly[15].sum() == pytest.approx((disparity[15].sum() + 2.5 * 6.0))


@pytest.mark.parametrize("slant", [-0.6, 0.4])
def test_foreshortening_bias_is_the_disparity_of_a_point_beside(view, slant):
    view, disparity = plane(view, (slant, 0.2, -1.0), 0.8)
    biased = EFFECTS["foreshortening_bias"](disparity, view, offset_px=2.0)
    np.testing.assert_allclose(biased[:, :-2], disparity[:, 2:], rtol=1e-9)
    tall = replace(view, K=view.K * np.array([[1.0, 1, 1], [1, 1.5, 1], [1, 1, 1]]))
    tall, disparity = plane(tall, (slant, 0.2, -1.0), 0.8)
    below = EFFECTS["foreshortening_bias"](disparity, tall, offset_down_px=3.0)
    np.testing.assert_allclose(below[:-3], disparity[3:], rtol=1e-9)


def test_fronto_parallel_walls_have_no_foreshortening_bias(view):
    view, disparity = plane(view, (0.0, 0.0, -1.0), 0.8)
    np.testing.assert_array_equal(EFFECTS["foreshortening_bias"](disparity, view, offset_px=2.0), disparity)


def test_post_filter_lowers_noise_within_surfaces_keeps_edges_and_rounds(view):
    rng = np.random.default_rng(3)
    clean = np.where(np.arange(90) < 45, 20.0, 9.0) * np.ones((60, 1))
    noisy = clean + 0.1 * rng.standard_normal(clean.shape)
    noisy[rng.random(clean.shape) < 0.1] = 0.0
    out = EFFECTS["post_filter"](noisy, view, smoothing_px=2.0, step_px=0.0)
    inside = (noisy > 0) & (np.abs(np.arange(90) - 44.5) > 8)
    assert (out - clean)[inside].std() < 0.2 * (noisy - clean)[inside].std()
    assert np.abs(out - noisy)[noisy > 0].max() < 1.0
    np.testing.assert_array_equal(out == 0, noisy == 0)
    steps = EFFECTS["post_filter"](noisy, view, smoothing_px=0.0, step_px=0.125) / 0.125
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_a_model_without_matcher_effects_gives_the_depth_it_is_given(view):
    depth = view.depth_m * (np.arange(view.shape[1]) % 5 > 0)
    np.testing.assert_array_equal(Model().depth(depth, view), depth)
    fitted = Model().with_effect(EFFECTS["pixel_locking"], amplitude_px=0.0).depth(depth, view)
    np.testing.assert_allclose(fitted, depth, rtol=1e-12)


def test_a_model_applies_disparity_effects_to_depth(view):
    model = Model().with_effect(EFFECTS["post_filter"], step_px=0.5)
    disparity = view.K[0, 0] * view.baseline_m / model.depth(view.depth_m, view)
    np.testing.assert_allclose(disparity * 2, np.rint(disparity * 2), atol=1e-9)


def test_matcher_effects_leave_the_infrared_image_alone(view):
    layers = example_value(Stage.PROJECTOR, view)
    model = Model()
    for e in EFFECTS.values():
        if e.stage >= Stage.DISPARITY:
            model = model.with_effect(e, **e.typical_values)
    assert len(model.effects) == 6
    nuisances = Nuisances(3e4, 9e3, 4.0)
    images = [m.signal(m.light(layers, view), view, nuisances) for m in (model, Model())]
    np.testing.assert_array_equal(*images)
