# SPDX-License-Identifier: Apache-2.0
"""A matt world's light from geometry is that of path tracing, with less noise."""

from dataclasses import replace

import numpy as np
import pytest

import kuafu
from activestereo.effects.engines import CaptureRenderer, base_layers
from activestereo.effects.engines.layers import Sampling, rig_request, sampling_of
from activestereo.compare.effect_trials import trial_capture

LIGHTS = ("direct", "flat", "indirect", "ambient", "ambient_direct")


@pytest.fixture(scope="module")
def views(device, tmp_path_factory):
    """{name: the left camera's pixels} by geometry with few samples, traced with as many, and with many."""
    capture = trial_capture(tmp_path_factory.mktemp("matt"))
    sampling = sampling_of(capture.rig, 2)
    rendered = {}
    for name, samples in (("geometry", 32), ("few", 32), ("many", 256)):
        request = rig_request(capture, capture.frames[0], samples, 4, 0, sampling)
        renderer = CaptureRenderer(device, traced=name != "geometry")
        rendered[name] = sampling.pixel_layers(renderer(request)[0])
    return rendered


def error(view, truth, light):
    """Root mean square, over that of the light itself."""
    difference = getattr(view, light).astype(float) - getattr(truth, light)
    return np.sqrt(np.mean(difference**2) / np.mean(getattr(truth, light).astype(float) ** 2))


@pytest.mark.parametrize("light", LIGHTS)
def test_light_is_that_of_path_tracing(views, light):
    by_geometry, few, truth = (views[name] for name in ("geometry", "few", "many"))
    assert getattr(by_geometry, light).sum() == pytest.approx(getattr(truth, light).sum(), rel=0.01)
    # Its samples are a quarter of the traced ones.
    assert error(by_geometry, truth, light) < 0.03 + 2.0 * error(few, truth, light)


def test_bounced_light_without_dots_is_that_with_dots_but_less_noisy(device, tmp_path, monkeypatch):
    capture = trial_capture(tmp_path)

    def bounced(blur_rad):
        monkeypatch.setattr(base_layers, "_DOTS_RAD", blur_rad)
        requests = (
            rig_request(capture, capture.frames[0], 16, 4, seed, sampling_of(capture.rig, 2)) for seed in (0, 1)
        )
        return [CaptureRenderer(device)(request)[0].indirect.astype(float) for request in requests]

    even, dotted = (bounced(blur_rad) for blur_rad in (base_layers._DOTS_RAD, 1e-6))
    assert np.sum(even) == pytest.approx(np.sum(dotted), rel=0.01)
    assert np.var(even[0] - even[1]) < 0.4 * np.var(dotted[0] - dotted[1])


def test_noise_of_direct_sky_light_cancels_in_the_bounced_one(device, tmp_path):
    capture = trial_capture(tmp_path)
    requests = (rig_request(capture, capture.frames[0], 16, 4, seed, sampling_of(capture.rig, 2)) for seed in (0, 1))
    first, second = (CaptureRenderer(device)(request)[0] for request in requests)
    whole, direct = (getattr(first, n).astype(float) - getattr(second, n) for n in ("ambient", "ambient_direct"))
    assert np.var(whole - direct) < 0.5 * (np.var(whole) + np.var(direct))  # 0.88 if they are independent


def test_depth_normals_and_materials_are_those_of_pixel_centres(views):
    np.testing.assert_allclose(views["geometry"].depth_m, views["few"].depth_m, rtol=1e-5)
    np.testing.assert_array_equal(views["geometry"].material, views["few"].material)
    np.testing.assert_allclose(views["geometry"].normal, views["few"].normal, atol=1e-5)


def test_geometry_and_paths_see_through_one_lens(device, tmp_path):
    capture, sampling = trial_capture(tmp_path), Sampling(2, 4)
    lens = replace(capture.rig.left, distortion=np.array([-0.04, 0.01, 0.002, -0.001, 0.0]))
    behind = replace(capture, rig=replace(capture.rig, left=lens))

    def seen(one, traced):
        request = rig_request(one, one.frames[0], 16, 1, 0, sampling)
        return sampling.pixel_layers(CaptureRenderer(device, traced=traced)(request)[0])

    matt, traced = seen(behind, False), seen(behind, True)
    np.testing.assert_allclose(matt.depth_m, traced.depth_m, rtol=1e-5)
    assert np.sqrt(np.mean((matt.flat - traced.flat) ** 2)) < 0.03 * traced.flat.mean()
    assert np.abs(seen(capture, False).depth_m - matt.depth_m).max() > 0.01


def test_light_on_a_painted_wall_is_that_on_a_plain_one_times_its_paint():
    """Lambert's law: what leaves a matt surface is its albedo times what arrives. The sky has its share."""
    wide, fine = (of_wall(size) for size in (1, base_layers.WIDE))
    arriving = 0.7
    sky = 30.0
    light = (arriving * wide.albedo + sky * (1.0 - wide.covered)).astype(np.float32)
    seen = base_layers.Spread.of(wide, fine, 300.0)(light[None], [sky])[0]
    assert 0.4 < fine.covered.mean() < 0.9 and len(np.unique(fine.covered)) > 2
    np.testing.assert_allclose(seen, arriving * fine.albedo + sky * (1.0 - fine.covered), rtol=0.01)


def test_a_sliver_of_wall_before_the_sky_is_no_lamp():
    """A wide pixel that the wall hardly enters tells nothing of the light that arrives there."""
    wide, fine = (of_wall(size) for size in (1, base_layers.WIDE))
    light = np.where(wide.covered == 1.0, 0.7 * wide.albedo, 1.0).astype(np.float32)
    seen = base_layers.Spread.of(wide, fine, 300.0)(light[None], [1.0])[0]
    assert seen.max() < 1.01


def of_wall(size):
    """A wall of tiles, 2 m before a camera of 16 x 12 pixels times size; the sky beside it from an odd column on."""
    height, width = 12 * size, 16 * size
    squares = 2 * base_layers.WIDE  # of the wide camera's pixels
    row, column = np.indices((12 * squares, 16 * squares)) / squares
    paint = np.where((np.floor(row / 1.7) + np.floor(column / 1.3)) % 2 == 0, 0.2, 0.8).astype(np.float32)
    albedo = np.where(column < 12.6, paint, 0.0).astype(np.float32)
    K = np.array([[300.0 * size, 0.0, 8.0 * size], [0.0, 300.0 * size, 6.0 * size], [0.0, 0.0, 1.0]])
    depth_m = np.where(np.arange(width) + 0.5 < 12.6 * size, 2.0, 0.0) * np.ones((height, 1))
    images = {"depth": depth_m[None, ..., None].astype(np.float32), "normal": np.zeros((1, height, width, 3))}
    images["normal"][..., 2] = -1.0
    finer = {"albedo": albedo[None, ..., None], "depth": (albedo > 0)[None, ..., None]}
    return base_layers.surfaces_of(images, 0, kuafu.Camera(width, height, K, np.eye(4)), finer)
