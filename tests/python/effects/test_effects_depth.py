# SPDX-License-Identifier: Apache-2.0
"""Effects on depth maps."""

from dataclasses import replace

import numpy as np
import pytest
from activestereo.compare.nuisances import Nuisances
from activestereo.effects import Model, Stage, builtin
from activestereo.effects.core.laws import example_value, example_view
from virtual_sensor.held_out.depth import _averaged, _filled

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
    facing, disparity = plane(view, (0.0, 0.0, -1.0), 0.8)
    np.testing.assert_array_equal(EFFECTS["foreshortening_bias"](disparity, facing, offset_px=2.0), disparity)


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


def test_a_models_matcher_effects_alone_change_the_depth_it_is_given(view):
    depth = view.depth_m * (np.arange(view.shape[1]) % 5 > 0)
    np.testing.assert_array_equal(Model().depth(depth, view), depth)
    fitted = Model().with_effect(EFFECTS["pixel_locking"], amplitude_px=0.0).depth(depth, view)
    np.testing.assert_allclose(fitted, depth, rtol=1e-12)
    stepped = Model().with_effect(EFFECTS["post_filter"], step_px=0.5).depth(view.depth_m, view)
    disparity = view.K[0, 0] * view.baseline_m / stepped
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


SHAPE = (60, 80)


def disparities(count, noise_px=0.05, holes=0.1, seed=3):
    """Frames of a scene at rest: a slanted plane with independent noise and holes."""
    rng = np.random.default_rng(seed)
    scene = 9.0 + 0.05 * np.arange(SHAPE[1]) * np.ones(SHAPE)
    return [(scene + noise_px * rng.standard_normal(SHAPE)) * (rng.random(SHAPE) >= holes) for _ in range(count)]


def filtered(frames, **parameters):
    """The last frame of a stream."""
    before = None
    for frame in frames:
        before = EFFECTS["temporal_filter"](frame, replace(example_view("left"), before=before), **parameters)
    return before


@pytest.mark.parametrize("alpha", [0.2, 0.4, 0.8])
def test_averaging_over_frames_divides_the_variance_of_a_scene_at_rest_by_2_less_alpha_over_alpha(alpha):
    frames = disparities(40, holes=0.0)
    scene = 9.0 + 0.05 * np.arange(SHAPE[1])
    variance = lambda image: np.var(image - scene)  # noqa: E731
    ratio = variance(frames[-1]) / variance(filtered(frames, alpha=alpha, delta_px=1.0))
    assert ratio == pytest.approx((2.0 - alpha) / alpha, rel=0.07)  # 4800 pixels: 2 % each


def test_a_step_larger_than_delta_passes_and_a_smaller_one_drags():
    still = [np.full(SHAPE, 10.0)] * 5
    assert filtered([*still, np.full(SHAPE, 11.0)], alpha=0.4, delta_px=0.9) == pytest.approx(11.0)
    assert filtered([*still, np.full(SHAPE, 10.5)], alpha=0.4, delta_px=0.9) == pytest.approx(10.2)


def test_holes_persist_only_where_that_is_asked():
    frames = disparities(30, holes=0.3)
    plain = filtered(frames, alpha=0.4, delta_px=1.0)
    kept = filtered(frames, alpha=0.4, delta_px=1.0, persists=1.0)
    np.testing.assert_array_equal(plain > 0, frames[-1] > 0)
    assert (kept > 0).all()


def test_a_stream_is_a_model_s_and_the_first_frame_passes():
    view = example_view("left")
    model = Model().with_effect(EFFECTS["temporal_filter"], alpha=0.4, delta_px=1.0)
    stream, depth = {}, view.depth_m
    np.testing.assert_allclose(model.depth(depth, view, stream), depth, rtol=1e-12)
    focal_baseline = view.K[0, 0] * view.baseline_m
    moved = focal_baseline / (focal_baseline / depth + 0.5)
    assert focal_baseline / model.depth(moved, view, stream) == pytest.approx(focal_baseline / depth + 0.2)
    np.testing.assert_allclose(model.depth(moved, view), moved, rtol=1e-12)  # a stream of its own


@pytest.mark.parametrize("neighbour", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("reach_px", [3.0, 500.0])
def test_filling_holes_makes_none_and_leaves_what_was_measured(neighbour, reach_px):
    [image] = disparities(1, holes=0.4)
    image[20:40, 30:50] = 0.0
    out = EFFECTS["hole_filling"](image, example_view("left"), reach_px=reach_px, neighbour=neighbour)
    measured = image > 0
    np.testing.assert_array_equal(out[measured], image[measured])
    assert set(np.unique(out)) <= set(np.unique(image))  # nothing is invented
    if reach_px == 3.0:
        assert (out[24:36, 34:46] == 0).all() and (out > 0).sum() > (image > 0).sum()
    elif neighbour == 0.0:
        assert (out[:, measured.argmax(axis=1).max() :] > 0).all()
    else:
        assert (out > 0).all()


def test_holes_take_the_far_or_the_near_side_of_an_edge():
    image = np.where(np.arange(80) < 40, 12.0, 5.0) * np.ones(SHAPE)
    image[:, 38:44] = 0.0
    at = lambda neighbour: EFFECTS["hole_filling"](image, example_view("left"), reach_px=6.0, neighbour=neighbour)  # noqa: E731
    np.testing.assert_array_equal(at(0.0)[:, 38:44], 12.0)
    image[:, 39:43] = [0.0, 0.0, 0.0, 5.0]
    image[:, 38] = 12.0  # three columns between: the middle one is as near to both sides
    assert [at(side)[30, 40] for side in (1.0, 2.0)] == [5.0, 12.0]


def test_the_benchmark_s_own_filters_do_the_same():
    """Its average forgets nothing but what is half a pixel off, and starts with the oldest frame that it is given."""
    frames = disparities(25, holes=0.0)
    own = _averaged(np.stack(frames[::-1]), 0.4)
    np.testing.assert_allclose(own, filtered(frames, alpha=0.4, delta_px=0.5), atol=2e-3)
    [image] = disparities(1, holes=0.5)
    ours = EFFECTS["hole_filling"](image, example_view("left"), reach_px=2.0, neighbour=0.0)
    np.testing.assert_array_equal(_filled(image, 2), ours)


def test_filters_are_not_ranked_and_say_why():
    for name in ("temporal_filter", "hole_filling"):
        assert EFFECTS[name].channel is None and "random" not in EFFECTS[name].unjudged_reason
