# SPDX-License-Identifier: Apache-2.0
"""Room light that was measured on surfaces: the lab's ambient layer is the scene's emission, with no bounce added; and
what a mask hides counts in no fit and no error."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

import kuafu
from activestereo.capture.capture import SIDES, Frame, Uncertainty
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects.engines.layers import RenderRequest
from activestereo.compare.nuisances import Nuisances, fit_nuisances, fit_under_model, fit_with_exposures
from activestereo.effects import Light as Seen, Model, builtin
from activestereo.effects.core.laws import example_view
from activestereo.scene_io.gltf_writer import GltfWriter
from activestereo.scene_io.meshes import sheet

K = np.array([[40.0, 0, 19.5], [0, 40.0, 14.5], [0, 0, 1.0]])


def layers_of(path, room_light, paint=None, seed=0, **how):
    """paint: PNG bytes, an albedo for each place of a surface."""
    writer = GltfWriter()
    if room_light:
        writer.set_extras(room_light="emission")
    for name, x, emission in (("dim", -2.0, 0.25), ("bright", 0.0, 0.75)):
        albedo = {"baseColorFactor": [0.5, 0.5, 0.5, 1.0]}
        if paint is not None:
            albedo = {"baseColorTexture": {"index": writer.add_texture(paint, name)}}
        material = writer.add_material(
            name, pbrMetallicRoughness={**albedo, "metallicFactor": 0.0},
            emissiveFactor=[emission] * 3, doubleSided=True,
            extensions={"KHR_materials_specular": {"specularFactor": 0.0}},
        )  # fmt: skip
        writer.add_placed_mesh(name, sheet((x, -2, 1), (2, 0, 0), (0, 4, 0)), material, np.eye(4))
    writer.write(path)
    camera = kuafu.Camera(40, 30, K, np.eye(4))
    pattern_K = np.array([[30.0, 0, 39.5], [0, 30.0, 29.5], [0, 0, 1.0]])  # wider than the camera
    projector = kuafu.Light(kind="projector", k=pattern_K, ir_intensity=1.0)
    request = RenderRequest(path, (camera,), projector, np.ones((60, 80), np.float32), 16, 4, seed)
    return CaptureRenderer("cpu", **how)(request)[0]


def test_the_ambient_layer_is_the_measured_emission(tmp_path):
    layers = layers_of(tmp_path / "room.gltf", room_light=True)
    np.testing.assert_allclose(layers.ambient[:, :18], 0.25, rtol=1e-4)
    np.testing.assert_allclose(layers.ambient[:, 22:], 0.75, rtol=1e-4)
    np.testing.assert_allclose(layers.ambient_direct, layers.ambient)


def test_without_it_light_comes_from_all_sides(tmp_path):
    layers = layers_of(tmp_path / "room.gltf", room_light=False)
    np.testing.assert_allclose(layers.ambient, 0.5, rtol=1e-3)  # an albedo of a half under 1 from all sides


def test_the_projectors_light_is_what_it_is_in_any_room(tmp_path):
    measured, even = (layers_of(tmp_path / f"{room}.gltf", room_light=room) for room in (True, False))
    assert even.direct.min() > 0
    np.testing.assert_allclose(measured.direct, even.direct, rtol=2e-3)
    np.testing.assert_allclose(measured.flat, even.flat, rtol=2e-3)
    assert measured.indirect.mean() == pytest.approx(even.indirect.mean(), abs=0.01 * even.direct.mean())


def test_a_painted_room_needs_no_samples_for_its_dots(tmp_path):
    """Its light off the first surface follows from geometry, as that of path tracing does in the mean."""
    paint = cv2.imencode(".png", np.random.default_rng(0).integers(90, 250, (16, 16), np.uint8).repeat(8, 0))[1]
    ways = ({"seed": 0}, {"seed": 1}, {"traced": True})
    first, second, traced = (layers_of(tmp_path / "room.gltf", True, paint.tobytes(), **way) for way in ways)
    for light in ("direct", "flat"):
        own, other = getattr(first, light), getattr(traced, light)
        np.testing.assert_array_equal(own, getattr(second, light))
        assert own.std() > 0.1 * own.mean() and np.abs(own - other).mean() < 0.03 * own.mean()
    np.testing.assert_allclose(first.ambient, traced.ambient, rtol=1e-4)


class Light:
    def __init__(self, rng):
        self.projector, self.ambient = rng.uniform(0, 1, (2, 30, 40))


def test_what_is_not_known_is_not_fitted():
    rng = np.random.default_rng(0)
    light = Light(rng)
    frame = Frame(0, None, None, 0.0, 1.0, np.eye(4), "train")
    measured = 100 * light.projector + 50 * light.ambient + 4
    foreign = measured.copy()
    foreign[:10] = np.nan
    fit = fit_nuisances([(frame, light, foreign)], 255.0)
    np.testing.assert_allclose(fit.nuisances.vector(), (100, 50, 4), atol=1e-6)
    assert fit.pixels == 20 * 40


@pytest.mark.parametrize("stated", [None, 0.05])
def test_exposures_that_are_not_exact_are_fitted_of_held_out_frames_too(stated):
    rng = np.random.default_rng(0)
    frames = [Frame(k, None, None, 0.0, 1.0, np.eye(4), "test" if k == 2 else "train") for k in range(3)]
    view = example_view()
    lights, views, measured = {}, {}, {}
    for frame, share in zip(frames, (1.0, 1.2, 0.7), strict=True):
        for side in SIDES:
            images = rng.uniform(0.1, 1, (4, *view.shape))
            lights[frame.id, side] = Seen.of_images(images)
            views[frame.id, side] = replace(view, frame=frame, side=side)
            measured[frame.id, side] = 4 + share * (50 * (images[0] + images[1]) + 30 * images[2])
    capture = SimpleNamespace(
        path="capture", frames=frames, check_train=lambda: None,
        split=lambda name: [f for f in frames if f.split == name],
        uncertainty=Uncertainty(exposure=stated), rig=SimpleNamespace(max_dn=255, black_dn=(4.0, 0.1)),
    )  # fmt: skip
    fit, seen = fit_with_exposures(capture, Model(), lights, views, measured)
    times = np.array([seen[k, "left"].frame.exposure_s for k in range(3)])
    if stated is None:
        assert (times == 1.0).all()
    else:
        np.testing.assert_allclose(times / times[0], (1.0, 1.2, 0.7), rtol=1e-3)
        assert fit.nuisances.black_dn == 4.0


@pytest.mark.parametrize("exponent", [0.37, 0.4, 2.5])
def test_a_fit_along_a_strongly_bent_line_ends_at_the_truth(exponent):
    rng = np.random.default_rng(0)
    view = example_view()
    model = Model().with_effect(builtin()["response_gamma"], log_exponent=np.log(exponent))
    light = Seen.of_images(rng.uniform(0.1, 1, (4, *view.shape)))
    measured = model.signal(light, view, Nuisances(8e3, 4e3, 4.0))
    fit = fit_under_model(model, [(view, light, measured)], 255)
    np.testing.assert_allclose(fit.nuisances.vector(), (8e3, 4e3, 4), rtol=1e-3)


def test_a_model_that_cannot_reach_what_was_measured_still_has_its_best_fit():
    """A rival that clips at a twentieth of the range: a step beyond it is halved, not an error."""
    rng = np.random.default_rng(0)
    view = example_view()
    model = Model().with_effect(builtin()["saturation_blooming"], lost_range=0.95, spill=0.3)
    light = Seen.of_images(rng.uniform(0.1, 1, (4, *view.shape)))
    measured = Model().signal(light, view, Nuisances(8e3, 4e3, 4.0))
    assert np.isfinite(fit_under_model(model, [(view, light, measured)], 255).nuisances.vector()).all()
