# SPDX-License-Identifier: Apache-2.0
"""The lab with inputs that change or lie outside the usual: deeper images, edited scenes, shared caches,
models by hand."""

import json
import threading
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import kuafu

from activestereo.capture.capture import Capture, CaptureError, read_capture
from activestereo.effects import Model
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.compare.depth_compare import DepthModel
from activestereo.effects.engines import CaptureRenderer
from activestereo.effects.core.view import Layers
from activestereo.effects.engines.layers import RenderRequest
from activestereo.compare.nuisances import fit_nuisances, fit_with_exposures
from activestereo.diagnose.diagnosis import diagnose
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD
from lab_worlds import WorldRenderer
from virtual_sensor.world import make_world


def test_a_deeper_pair_has_the_depth_of_its_8_bit_one(tmp_path):
    make_world(tmp_path, size=(96, 64))
    capture = read_capture(tmp_path / "capture")
    random = np.random.default_rng(5)
    row = random.integers(0, 256, (capture.rig.left.height, capture.rig.left.width + 9))
    left, right = row[:, : capture.rig.left.width].astype(np.float32), row[:, 9:].astype(np.float32)
    shallow = DepthModel(capture).depth(left, right)
    deep = DepthModel(replace(capture, rig=replace(capture.rig, bit_depth=12))).depth(16 * left, 16 * right)
    assert (shallow > 0).mean() > 0.5
    np.testing.assert_array_equal(deep, shallow)


def small_request(scene, cameras):
    k = np.array([[60.0, 0, 32], [0, 60.0, 24], [0, 0, 1]])
    projector = kuafu.Light(kind="projector", k=k, ir_intensity=1.0, light_to_world=CAMERA_TO_WORLD)
    seen = (kuafu.Camera(64, 48, k, CAMERA_TO_WORLD),) * cameras
    return RenderRequest(scene, seen, projector, np.ones((8, 8), np.float32), 1, 1, 0)


def test_an_edited_scene_is_rendered_anew(table_top, tmp_path):
    scene = tmp_path / "scene.gltf"
    scene.write_bytes(table_top.read_bytes())
    request = small_request(scene, 1)
    renderer = CaptureRenderer(smooth=False)
    [bright] = renderer(request)
    document = json.loads(scene.read_text())
    for material in document["materials"]:
        material["extras"] = {"ir_albedo": 0.01}
    scene.write_text(json.dumps(document))
    [dark] = renderer(request)
    assert dark.ambient.mean() < 0.2 * bright.ambient.mean()


def test_images_are_smoothed_in_threads_that_leave_the_scene_alone(table_top, monkeypatch):
    """A scene refuses a second call beside the first, however short both are."""
    read = kuafu.Scene.get_material

    def of_one_thread(scene, number):
        assert threading.current_thread() is threading.main_thread(), "a scene is one thread's at a time"
        return read(scene, number)

    monkeypatch.setattr(kuafu.Scene, "get_material", of_one_thread)
    request = small_request(table_top, 2)
    left, right = CaptureRenderer(smooth=True)(request)
    raw, _ = CaptureRenderer(smooth=False)(request)
    np.testing.assert_array_equal(left.ambient, right.ambient)
    assert np.any(left.ambient != raw.ambient)


def test_a_cache_may_lose_entries_to_another_run_meanwhile(tmp_path, monkeypatch):
    cache = LayerCache(tmp_path)
    layers = (Layers(*(np.zeros((2, 2), np.float32) for _ in fields(Layers))),)
    cache.put("first", layers)
    glob = type(tmp_path).glob
    monkeypatch.setattr(type(tmp_path), "glob", lambda self, pattern: [*glob(self, pattern), self / "gone.npz"])
    cache.put("second", layers)

    def vanished(path):
        raise FileNotFoundError(path)

    monkeypatch.setattr("os.utime", vanished)
    assert len(cache.get("second")) == 1


@pytest.mark.parametrize("judge", [compare, diagnose])
def test_a_capture_without_train_frames_is_refused_before_it_is_rendered(judge, tmp_path):
    world = make_world(tmp_path, size=(80, 45), grid=1)
    folder, renderer = world.capture_path, WorldRenderer(world, grid=1)
    values = json.loads((folder / "capture.json").read_text())
    for frame in values["frames"]:
        frame["split"] = "test"
    (folder / "capture.json").write_text(json.dumps(values))
    with pytest.raises(CaptureError, match="capture.json: frames: split: is 'test' in all frames: say 'train' in"):
        judge(folder, renderer=renderer)
    assert renderer.calls == 0


def test_a_fit_names_a_capture_without_train_frames_and_images_that_are_none(tmp_path):
    capture = SimpleNamespace(path=tmp_path / "desk", split=lambda name: [])
    capture.check_train = lambda: Capture.check_train(capture)
    with pytest.raises(CaptureError, match="desk/capture.json: frames: split: is 'test' in all frames"):
        fit_with_exposures(capture, Model(), {}, {}, {})
    with pytest.raises(ValueError, match="nothing to fit: there is no infrared image"):
        fit_nuisances([], 255.0)
