# SPDX-License-Identifier: Apache-2.0
"""The comparison of a capture with the simulator: fits, floors, caches, practice captures."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from activestereo.capture.capture import read_capture
from activestereo.capture.images import write_gray
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.compare.nuisances import Nuisances, fit_nuisances, predict
from activestereo.compare.render import WARP_SCALE, render_frames
from activestereo.effects import Model, View, builtin
from activestereo.effects.engines.layers import request_key, rig_request
from activestereo.report.summary import what_is_missed
from lab_worlds import RememberingRenderer, WorldRenderer, error_of_truth

import kuafu


@pytest.fixture(scope="module")
def comparison(lab_world, lab_cache):
    return compare(lab_world.capture_path, renderer=WorldRenderer(lab_world, grid=3), cache=lab_cache)


def test_the_fit_finds_what_the_world_was_made_with(lab_world, comparison):
    fit = comparison.scores["fit"]["nuisances"]
    assert fit["projector_scale"] == pytest.approx(lab_world.sensor.projector_scale, rel=0.01)
    assert fit["ambient_scale"] == pytest.approx(lab_world.sensor.ambient_scale, rel=0.02)
    assert fit["black_dn"] == pytest.approx(lab_world.sensor.black_dn, abs=0.1)


def test_noise_floor_is_the_worlds_own_noise(lab_world, comparison):
    """Against the residual of the noise-free truth itself, which no model can beat."""
    capture = comparison.capture
    for split in ("train", "test"):
        floor = comparison.scores["ir"][split]["noise_floor_dn"]
        assert floor == pytest.approx(error_of_truth(lab_world, capture, split), rel=0.03)


def test_the_right_model_leaves_little_to_explain(comparison):
    for split in ("train", "test"):
        values = comparison.scores["ir"][split]
        assert values["rmse_dn"] < 1.06 * values["noise_floor_dn"]
        more = max(0, values["rmse_dn"] ** 2 - values["noise_floor_dn"] ** 2)
        assert values["explainable_rmse_dn"] ** 2 == pytest.approx(more, abs=1e-9)


def test_a_wrong_scene_leaves_much_to_explain(lab_world, comparison, tmp_path):
    wrong = replace(lab_world, solids=tuple(s for s in lab_world.solids if s.name != "ball"))
    scores = compare(lab_world.capture_path, renderer=WorldRenderer(wrong, grid=2), cache=LayerCache(tmp_path)).scores
    for split in ("train", "test"):
        assert scores["ir"][split]["explainable_rmse_dn"] > 3 * comparison.scores["ir"][split]["explainable_rmse_dn"]


def test_rmse_pools_squares_over_cameras_and_frames(comparison):
    frames = [f for f in comparison.scores["frames"] if f["split"] == "train"]
    pooled = np.sqrt(np.mean([f["cameras"][side]["rmse_dn"] ** 2 for f in frames for side in ("left", "right")]))
    assert comparison.scores["ir"]["train"]["rmse_dn"] == pytest.approx(pooled)


def test_saturated_pixels_do_not_bias_the_fit(lab_world, lab_cache):
    """The same light measured by a sensor that clips a tenth of the dots gives the same scales."""
    capture = read_capture(lab_world.capture_path)
    layers = render_frames(capture, WorldRenderer(lab_world), cache=lab_cache)
    truth, limit = Nuisances(9.0e4, 3.0e3, 4.0), 60.0
    rng = np.random.default_rng(5)
    observations = []
    for frame in capture.frames:
        light = predict(frame, layers[frame.id]["left"], truth, np.inf)
        observations.append((frame, layers[frame.id]["left"], np.clip(light + rng.normal(size=light.shape), 0, limit)))
    fit = fit_nuisances(observations, limit)
    assert fit.clipped_fraction > 0.02
    np.testing.assert_allclose(fit.nuisances.vector(), truth.vector(), rtol=4e-3)


def test_fit_without_clipping_is_plain_least_squares(comparison, lab_world, lab_cache):
    capture = comparison.capture
    layers = render_frames(capture, WorldRenderer(lab_world), cache=lab_cache)
    train = [(f, layers[f.id][side], capture.ir(f, side)) for f in capture.split("train") for side in ("left", "right")]
    rows = []
    for f, l, _ in train:
        columns = l.projector * f.exposure_gain * f.projector_power, l.ambient * f.exposure_gain, 0 * l.ambient + 1
        rows.append(np.stack(columns, -1).reshape(-1, 3).astype(np.float64))
    value = np.concatenate([m.ravel() for _, _, m in train]).astype(np.float64)
    expected = np.linalg.lstsq(np.concatenate(rows), value, rcond=None)[0]
    np.testing.assert_allclose(fit_nuisances(train, np.inf).nuisances.vector(), expected, rtol=1e-4)


def test_frames_of_one_pose_share_a_render_and_a_second_run_traces_nothing_that_is_whole(lab_world, tmp_path):
    renderer, capture = WorldRenderer(lab_world, grid=1), read_capture(lab_world.capture_path)
    first = render_frames(capture, renderer, cache=LayerCache(tmp_path))
    assert renderer.calls == 3  # poses, not frames
    second = render_frames(capture, renderer, cache=LayerCache(tmp_path))
    assert renderer.calls == 3
    np.testing.assert_array_equal(first[4]["right"].direct, second[4]["right"].direct)
    for entry in tmp_path.glob("*.npz"):
        entry.write_bytes(entry.read_bytes()[:500])
    render_frames(capture, renderer, cache=LayerCache(tmp_path))
    assert renderer.calls == 6


def test_the_cache_key_follows_everything_that_decides_pixels(lab_world, tmp_path):
    copy = Path(shutil.copytree(lab_world.capture_path, tmp_path / "copy"))
    capture = read_capture(copy)
    base = rig_request(capture, capture.frames[0], 64, 8, 0)
    key, first = request_key(base, "1"), base.cameras[0]
    k = first.k + np.diag([1e-9, 1e-9, 0.0])
    longer = kuafu.Camera(first.width, first.height, k, first.camera_to_world)
    assert key == request_key(rig_request(capture, capture.frames[1], 64, 8, 0), "1")
    others = [
        replace(base, samples_per_pixel=65),
        replace(base, max_bounces=9),
        replace(base, seed=1),
        replace(base, pattern=base.pattern + np.float32(1e-3)),
        replace(base, cameras=(longer, base.cameras[1])),
        rig_request(capture, capture.frames[2], 64, 8, 0),
    ]
    keys = [request_key(other, "1") for other in others] + [request_key(base, "2")]
    (copy / "scene.bin").write_bytes((copy / "scene.bin").read_bytes()[:-4] + b"abcd")
    keys.append(request_key(base, "1"))
    assert len({key, *keys}) == len(keys) + 1


def test_an_effect_that_the_world_has_makes_the_error_fall(lab_world, comparison, tmp_path):
    """A sensor of bent response: the base model fails, the model with the effect is at the floor again."""
    gamma = builtin()["response_gamma"]
    model = Model().with_effect(gamma, log_exponent=np.log(0.8))
    copy = Path(shutil.copytree(lab_world.capture_path, tmp_path / "copy"))
    capture = read_capture(copy)
    renderer = RememberingRenderer(WorldRenderer(lab_world, grid=3))
    layers = render_frames(capture, renderer, cache=LayerCache(tmp_path / "cache"), scale=WARP_SCALE)
    truth, rng = Nuisances(9.0e4, 3.0e3, 4.0), np.random.default_rng(8)
    for frame in capture.frames:
        for side in ("left", "right"):
            view = View.of(capture, frame, side, layers[frame.id][side])
            image = model.signal(model.light(layers[frame.id][side], view), view, truth) + rng.normal(size=view.shape)
            write_gray(frame.path(side), np.clip(np.rint(image), 0, 255).astype(np.uint8))
    base, right = (compare(copy, m, renderer, cache=LayerCache(tmp_path / "cache")).scores for m in (None, model))
    for split in ("train", "test"):
        assert base["ir"][split]["rmse_dn"] > 1.5 * right["ir"][split]["rmse_dn"]
        assert right["ir"][split]["rmse_dn"] == pytest.approx(np.sqrt(1 + 1 / 12), rel=0.02)
    np.testing.assert_allclose(list(right["fit"]["nuisances"].values()), truth.vector(), rtol=0.01)
    assert (base["effects"], right["effects"]) == ([], ["response_gamma"])


_ROOT = Path(__file__).resolve().parents[3]
_CAPTURES = Path(os.environ.get("ACTIVESTEREO_DATA") or _ROOT.parent / "shared") / "captures"
_QUICK = "practice-01"


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    build = os.environ.get("ACTIVESTEREO_BUILD")
    return LayerCache(Path(build) / "layers" if build else tmp_path_factory.mktemp("layers"))


@pytest.mark.parametrize("name", [f"practice-0{i}" for i in range(1, 10)])
def test_ir_error_is_the_oracles_within_three_percent(name, cache, tmp_path):
    source = _CAPTURES / name
    if not source.is_dir():
        pytest.skip(f"{source} is absent (set ACTIVESTEREO_DATA)")
    if name != _QUICK and not os.environ.get("ACTIVESTEREO_FULL"):
        pytest.skip("set ACTIVESTEREO_FULL=1 to compare all captures")
    # The tool sees a copy without the answer.
    without_answer = shutil.copytree(source, tmp_path / name, ignore=shutil.ignore_patterns("answer.json"))
    samples_per_pixel = 64 if os.environ.get("ACTIVESTEREO_FULL") else 16
    scores = compare(without_answer, samples_per_pixel=samples_per_pixel, cache=cache).scores
    answer = json.loads((source / "answer.json").read_text())
    oracle = answer["oracle"]["ir_rmse_dn"]
    for split in ("train", "test"):
        assert scores["ir"][split]["rmse_dn"] == pytest.approx(oracle[split]["before"], rel=0.03)
        assert scores["ir"][split]["noise_floor_dn"] == pytest.approx(oracle[split]["floor"], rel=0.03)
    said = " ".join(what_is_missed(scores))
    for hidden in answer["effects"]:
        assert f" {builtin()[hidden['effect']].family}" in said, said
    assert answer["effects"] or "at the noise floor" in said
