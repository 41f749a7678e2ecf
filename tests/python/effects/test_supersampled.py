# SPDX-License-Identifier: Apache-2.0
"""Supersampled images: warps that look between and beyond pixels, lenses of the nominal rig, and the filter of bounced
light."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import kuafu
from activestereo.capture.capture import Camera, CaptureError
from activestereo.compare.cache import LayerCache
from activestereo.compare.effect_trials import trial_capture
from activestereo.compare.render import render_frames
from activestereo.effects import Light, Model, Stage, builtin
from activestereo.effects.core.laws import example_value, example_view
from activestereo.effects.core.resample import SupersampledImages, blur
from activestereo.common.lens import to_tangents, undistort
from activestereo.effects.core.view import Layers
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects.engines.layers import Sampling
from activestereo.effects.engines.smooth import Surfaces, is_matt_surface, smooth_bounced

K = np.array([[60.0, 0, 47.5], [0, 60.0, 35.5], [0, 0, 1]])
LENS = np.array([-0.12, 0.03, 0.002, -0.001, 0.004])


def radiance(x, y):
    """A picture by direction, with detail near the pixel's size."""
    return 1.2 + np.sin(40 * x + 3 * y) * np.cos(35 * y) * 0.8


def rendered(camera, sampling):
    """Layers of the picture as a renderer gives them: means over samples, the depth a slanted plane's."""
    supersampled = sampling.camera(kuafu.Camera(camera.width, camera.height, camera.K, np.eye(4)))
    within, k = (np.arange(4) - 1.5) / 4, supersampled.k
    v, u = np.mgrid[0 : supersampled.height, 0 : supersampled.width].astype(float)

    def direction(du, dv):
        return (u + du - k[0, 2]) / k[0, 0], (v + dv - k[1, 2]) / k[1, 1]

    image = np.mean([radiance(*direction(a, b)) for a in within for b in within], axis=0).astype(np.float32)
    x, y = direction(0, 0)
    depth = (1.0 / (1.0 + 0.2 * x)).astype(np.float32)
    normal = np.broadcast_to(np.float32([0, 0, -1]), (*depth.shape, 3))
    return Layers(image, image, image, image, depth, normal, np.zeros(depth.shape, np.uint32))


def truth(camera, to_ideal):
    """Pixel means of the picture under any lens: to_ideal maps drawn directions to ideal ones."""
    within = (np.arange(16) - 7.5) / 16
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    total = 0.0
    for a in within:
        for b in within:
            drawn = (u + a - camera.K[0, 2]) / camera.K[0, 0], (v + b - camera.K[1, 2]) / camera.K[1, 1]
            total = total + radiance(*to_ideal(*drawn))
    return total / 256


def test_a_warp_of_fine_images_is_sharp_up_to_the_border():
    view, camera = example_view(), Camera(96, 72, K)
    k1 = -0.03
    expected = truth(camera, lambda x, y: undistort(x, y, (k1, 0, 0, 0, 0)))
    errors = {}
    for scale in (1, 2):
        sampling = Sampling(scale, 6 if scale > 1 else 0)
        moved = builtin()["radial_distortion"](Light.of(sampling.pixel_layers(rendered(camera, sampling))), view, k1=k1)
        errors[scale] = np.sqrt(np.mean((moved.ambient - expected) ** 2))
        assert moved.ambient.shape == view.shape
    assert errors[2] < 0.01 * expected.std()
    assert errors[1] > 5 * errors[2]


def test_what_effects_changed_before_a_warp_is_warped_with_the_rest():
    view, camera, sampling = example_view(), Camera(96, 72, K), Sampling(2, 4)
    light = Light.of(sampling.pixel_layers(rendered(camera, sampling)))
    dimmed = light.scale_projector(0.25)
    one_after_the_other = builtin()["radial_distortion"](dimmed, view, k1=-0.02)
    other_order = builtin()["radial_distortion"](light, view, k1=-0.02).scale_projector(0.25)
    np.testing.assert_allclose(one_after_the_other.ambient, other_order.ambient)
    assert np.sqrt(np.mean((one_after_the_other.direct - other_order.direct) ** 2)) < 0.05 * other_order.direct.std()


def test_finer_pixels_stand_behind_the_nominal_lens():
    """The pixel means of a finer, wider image are the picture as the lens draws it."""
    camera, sampling = kuafu.Camera(96, 72, K, np.eye(4), distortion=tuple(LENS)), Sampling(2, 4)
    fine = sampling.camera(camera)
    assert fine.distortion == camera.distortion and (fine.width, fine.height) == (208, 160)
    v, u = np.mgrid[0:72, 0:96].astype(float)
    at = ((x + sampling.margin_px + 0.5) * sampling.scale - 0.5 for x in (u, v))
    np.testing.assert_allclose(to_tangents(*at, fine.k, LENS), to_tangents(u, v, K, LENS), atol=1e-9)


def test_a_lens_that_folds_back_is_refused(tmp_path):
    capture = trial_capture(tmp_path)
    lens = replace(capture.rig.left, distortion=np.array([-0.45, 0.0, 0.0, 0.0, 0.0]))
    folding = replace(capture, rig=replace(capture.rig, left=lens, right=lens))
    with pytest.raises(CaptureError, match=r"capture.json: rig: .*folds back"):
        render_frames(folding, CaptureRenderer(), 1, 0, cache=LayerCache(tmp_path))


@pytest.mark.parametrize(
    "fields, is_matt",
    [
        ({"specular": 0.0, "roughness": 0.0}, True),
        ({"roughness": 0.1}, False),
        ({"roughness": 0.5, "clearcoat": 1.0, "clearcoat_roughness": 0.1}, False),
        ({"roughness": 0.5, "clearcoat": 1.0, "clearcoat_roughness": 0.5}, True),
    ],
)
def test_a_surface_with_a_smooth_lobe_is_not_matt(fields, is_matt):
    assert is_matt_surface(kuafu.Material(metallic=0.0, **fields)) == is_matt


def test_bounced_light_is_smoothed_along_a_surface_and_not_across_materials():
    rng = np.random.default_rng(2)
    v, u = np.mgrid[0:72, 0:96].astype(float)
    depth = np.full(u.shape, 0.8)
    points = np.stack([(u - 47.5) / 215 * depth, (v - 35.5) / 215 * depth, depth], axis=-1)
    normal = np.broadcast_to([0.0, 0.0, -1.0], points.shape)
    material = (u > 40).astype(np.uint32)
    clean = np.where(material, 0.3, 1.0) * (1 + 0.002 * v)
    noisy = clean * rng.gamma(10, 0.1, clean.shape)
    filtered = smooth_bounced(noisy, Surfaces.of(depth, normal, points, material), 215.0)
    error, noise = ((image - clean).std() for image in (filtered, noisy))
    assert error < 0.15 * noise
    assert filtered.mean() == pytest.approx(noisy.mean(), rel=0.005)
    assert abs((filtered - clean)[:, 36:46].mean(axis=0)).max() < 0.05


@pytest.mark.parametrize("sigma_px", [0.4, 3.0])
def test_a_blur_is_the_same_where_opencv_is_missing(monkeypatch, sigma_px):
    images = np.random.default_rng(4).random((2, 31, 43)).astype(np.float32)
    with_opencv = blur(images, sigma_px)
    monkeypatch.setitem(sys.modules, "cv2", None)
    without = blur(images, sigma_px)
    assert without.dtype == with_opencv.dtype
    np.testing.assert_allclose(without, with_opencv, atol=1e-6)


def test_a_pixel_of_a_warped_image_is_the_mean_of_its_samples():
    """A warp looks up means where whole images or some pixels are asked for, and samples for what follows it."""
    view = example_view("left")
    camera = Camera(view.shape[1], view.shape[0], K)
    sampling = Sampling(2, 3)
    light = Light.of(sampling.pixel_layers(rendered(camera, sampling)))
    u, v = view.pixels()
    for moved_u, moved_v, error in ((u + 0.3, v - 0.4, 1e-5), (1.02 * u - 1.0, v + 0.01 * u, 2e-3)):
        by_samples = light.supersampled.warped(moved_u, moved_v).images()
        edge = sampling.margin_px * sampling.scale
        inside = by_samples[:, edge:-edge, edge:-edge].reshape(4, view.shape[0], 2, view.shape[1], 2).mean((2, 4))
        warped = light.warped(moved_u, moved_v)
        assert np.abs(warped.direct - inside[0])[2:-2, 2:-2].max() < error * inside.max()
        pick = np.array([7, 500, 1234])
        again = light.warped(moved_u, moved_v).seen(pick)
        assert again[0] == pytest.approx(warped.projector.ravel()[pick], rel=1e-5)
        assert again[1] == pytest.approx(warped.ambient.ravel()[pick], rel=1e-5)


def test_picked_pixels_of_a_changed_light_are_those_of_its_warped_image():
    """Effects before the lens change pixels, of which no finer samples exist."""
    view = example_view("left")
    u, v = view.pixels()
    sampling = Sampling(2, 3)
    light = Light.of(sampling.pixel_layers(rendered(Camera(view.shape[1], view.shape[0], K), sampling)))
    light = light.scale_projector(1.0 + 0.2 * np.sin(u / 9.0))
    whole, some = (light.warped(u + 0.3, 1.01 * v) for _ in range(2))
    pick = np.array([7, 500, 1234])
    for image, seen in zip((whole.projector, whole.ambient), some.seen(pick), strict=True):
        assert seen == pytest.approx(image.ravel()[pick], rel=1e-6)


def test_two_warps_are_one():
    """The second warp's places are looked up in the first one's map, so nothing is interpolated twice."""
    view = example_view("left")
    sampling = Sampling(2, 3)
    images = Light.of(sampling.pixel_layers(rendered(Camera(view.shape[1], view.shape[0], K), sampling))).supersampled
    u, v = view.pixels()
    twice = images.warped(1.02 * u + 0.4, v - 0.3).warped(u - 0.8, v + 0.2)
    once = images.warped(1.02 * (u - 0.8) + 0.4, v - 0.1)
    assert np.abs(twice.pixels() - once.pixels())[:, 2:-2, 2:-2].max() < 1e-4 * images.pixels().max()


def test_images_of_equal_maps_alone_are_shared():
    images = SupersampledImages(np.ones((1, 90, 90), np.float32), 1, 0)
    u, v = np.meshgrid(np.arange(90.0), np.arange(90.0))
    kept = images.warped(u, v)
    other = u.copy()
    other[0, 1:3] += 1.0, -1.0
    assert images.warped(u.copy(), v) is kept and images.warped(other, v) is not kept


POINTWISE_IN_LIGHT = [e for e in builtin().values() if e.is_pointwise and e.stage < Stage.CHARGE]


@pytest.mark.parametrize("effect", POINTWISE_IN_LIGHT, ids=lambda e: e.id)
def test_pixels_that_are_picked_are_those_of_the_whole_image(effect):
    view = example_view()
    light = example_value(effect.stage, view)
    pick = np.random.default_rng(4).permutation(view.depth_m.size)[:200]
    picked = Model().with_effect(effect, **effect.typical_values).light(light, view).seen(pick)
    whole = effect(light, view, **effect.typical_values)
    for image, some in zip((whole.projector, whole.ambient), picked, strict=True):
        np.testing.assert_allclose(some, image.ravel()[pick], rtol=1e-12)
    assert (whole.projector != light.projector).any()
