# SPDX-License-Identifier: Apache-2.0
"""Pixels that masks hide count in no part of a diagnosis, a measured black level is held, frames share light."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from activestereo.capture.capture import read_capture
from activestereo.capture.images import read_gray, write_gray
from activestereo.compare.cache import LayerCache
from activestereo.compare.render import render_frames
from activestereo.diagnose.diagnosis import _within_reach
from activestereo.diagnose.evidence import edge_slopes, one_of_each_situation
from activestereo.diagnose.fitter import Fitter, ParameterSpace
from activestereo.diagnose.gather import gather
from activestereo.diagnose.pixels import LightMemory
from activestereo.effects import Model, builtin
from activestereo.effects.core.laws import example_view
from activestereo.effects.core.view import Layers
from activestereo.scene_io.gltf_writer import GltfWriter
from lab_worlds import WorldRenderer

HIDDEN = np.s_[20:70, 90:150]


def masked(world, folder, spoiled):
    """The world's capture with a mask over HIDDEN, and something foreign below it where it is spoiled."""
    path = shutil.copytree(world.capture_path, folder)
    content = json.loads((path / "capture.json").read_text())
    known = np.full((90, 160), 255, np.uint8)
    known[HIDDEN] = 0
    write_gray(path / "known.png", known)
    for frame in content["frames"]:
        for side in ("left", "right"):
            frame[f"{side}_mask"] = "known.png"
            if spoiled:
                image = read_gray(path / frame[side], key=side).copy()
                image[HIDDEN] = 255 - image[HIDDEN]
                write_gray(path / frame[side], image)
    (path / "capture.json").write_text(json.dumps(content))
    return path


def fitted(world, path, tmp_path):
    capture = read_capture(path)
    renderer = WorldRenderer(world, grid=2, bounces=1)
    evidence = gather(capture, render_frames(capture, renderer, cache=LayerCache(tmp_path / "cache"), scale=2))
    fitter = Fitter(evidence.train, evidence.nuisance_prior(), evidence.tiles)
    space = ParameterSpace.of(Model(), builtin()["vignetting"])
    return evidence, fitter, fitter.refine(space, space.start, fitter.phi0(evidence.nuisances), 4)


def test_what_a_mask_hides_counts_nowhere(wide_world, tmp_path):
    clean = fitted(wide_world, masked(wide_world, tmp_path / "clean", spoiled=False), tmp_path)
    spoiled = fitted(wide_world, masked(wide_world, tmp_path / "spoiled", spoiled=True), tmp_path)
    count = 160 * 90 - 50 * 60
    for evidence, fitter, solution in (clean, spoiled):
        assert evidence.pixels == fitter.tile_pixels().sum() == count * len(evidence.train)
        for row in fitter.residuals(solution):
            assert not row.residual[HIDDEN].any() and not row.observation.weight[HIDDEN].any()
        assert all(o.view.known.ravel()[o.pick].all() for o in one_of_each_situation(evidence.train))
    np.testing.assert_allclose(spoiled[2].phi[:3], clean[2].phi[:3], rtol=0.01)
    assert spoiled[2].sums.total == pytest.approx(clean[2].sums.total, rel=0.03)


def test_a_scene_that_no_camera_sees_is_refused(wide_world, tmp_path):
    path = shutil.copytree(wide_world.capture_path, tmp_path / "capture")
    content = json.loads((path / "capture.json").read_text())
    for frame in content["frames"]:
        frame["camera_to_world"][3] += 500.0
    (path / "capture.json").write_text(json.dumps(content))
    with pytest.raises(ValueError, match="the left and the right camera sees no surface"):
        fitted(wide_world, path, tmp_path)


def test_a_measured_black_level_is_held_and_its_deviation_told(wide_world, tmp_path):
    path = shutil.copytree(wide_world.capture_path, tmp_path / "capture")
    content = json.loads((path / "capture.json").read_text())
    found = []
    for black in (None, [3.0, 0.2], [3.0, 0.8]):
        content["rig"] |= {} if black is None else {"black_dn": black}
        (path / "capture.json").write_text(json.dumps(content))
        evidence, fitter, solution = fitted(wide_world, path, tmp_path)
        found.append((evidence.nuisances.black_dn, solution.phi[2], fitter.covariance(solution)[0, 0]))
    assert abs(found[0][1] - 3.0) > 0.2
    for first, last, _ in found[1:]:
        assert first == 3.0 and last == pytest.approx(3.0, abs=0.01)
    narrow, wide = found[1][2], found[2][2]
    assert wide > narrow


@pytest.mark.parametrize("is_measured", [False, True])
def test_a_measured_texture_may_stand_elsewhere_and_dots_may_not(is_measured):
    room, dots = np.ones((20, 30)), np.zeros((20, 30))
    room[:, 15:], dots[5:8, 5:8] = 2.0, 30.0
    view = SimpleNamespace(
        depth_m=np.full((20, 30), 2.0), K=np.diag([100.0, 100.0, 1.0]), once=lambda name, make: make(),
        known=np.ones((20, 30), bool) if is_measured else None,
    )  # fmt: skip
    layers = SimpleNamespace(ambient=room, material=np.zeros((20, 30), np.uint32))
    slopes = edge_slopes(SimpleNamespace(view=view, layers=layers), 10.0 * room + dots)
    expected = np.zeros((20, 30))
    expected[:, 14:16] = 5.0 * 100.0 / 2.0  # 5 DN per pixel, 50 pixels per metre
    np.testing.assert_allclose(slopes, expected * is_measured, rtol=1e-6)


def test_effects_of_single_surfaces_are_not_ranked_in_a_room_that_was_measured(tmp_path):
    room = GltfWriter()
    room.set_extras(room_light="emission")
    GltfWriter().write(tmp_path / "modelled.gltf"), room.write(tmp_path / "measured.gltf")
    for name, told in (("modelled", []), ("measured", ["specular"])):
        effects = [builtin()["specular"], builtin()["vignetting"]]
        capture = SimpleNamespace(scene_path=tmp_path / f"{name}.gltf", binning=1)
        chosen, others = _within_reach(SimpleNamespace(capture=capture), effects)
        assert [e.id for e, _ in others] == told
        assert [e.id for e in chosen] == [e for e in ("specular", "vignetting") if e not in told]


@pytest.fixture()
def observations():
    view = example_view("left")
    image = np.random.default_rng(1).random(view.shape)
    layers = Layers(image, 0.1 * image, image, image, view.depth_m, view.normal, np.zeros(view.shape, np.uint32))
    frames = (replace(view.frame, id=i, timestamp_s=0.0013 * i) for i in range(3))
    views = [replace(view, frame=frame) for frame in frames]
    views[2] = replace(views[2], frame=replace(views[2].frame, temperature_c=70.0))
    return [SimpleNamespace(side=v.side, frame=v.frame, view=v, layers=layers) for v in views]


@pytest.mark.parametrize(
    ("name", "values", "shared"),
    [
        ("vignetting", {"exponent": 2.0}, 3),
        ("chromatic_drift", {"transmission_per_k": -0.01}, 2),  # the third frame is warmer
        ("flicker_banding", {"depth": 0.5, "frequency_hz": 100.0, "line_time_s": 5e-5}, 1),
    ],
)
def test_a_light_is_shared_where_the_effect_looks_at_nothing_else(observations, name, values, shared):
    model, memory = Model().with_effect(builtin()[name], **values), LightMemory(observations)
    lights = [memory(model, i) for i in range(3)]
    assert [light is lights[0] for light in lights] == [i < shared for i in range(3)]
    for light, o in zip(lights, observations, strict=True):
        assert light.images == pytest.approx(model.light(o.layers, o.view).images)


def test_what_comes_after_a_flicker_is_not_shared(observations):
    effects = builtin()
    model = Model().with_effect(effects["flicker_banding"], depth=0.5).with_effect(effects["vignetting"], exponent=2.0)
    memory = LightMemory(observations)
    for i, o in enumerate(observations):
        assert memory(model, i).images == pytest.approx(model.light(o.layers, o.view).images)
