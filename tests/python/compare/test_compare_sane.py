# SPDX-License-Identifier: Apache-2.0
"""A comparison says first what is another one than stated: pattern, scene, cameras, scales, rows."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from activestereo.capture.capture import read_capture
from activestereo.capture.images import read_gray, write_gray
from activestereo.compare.cache import LayerCache
from activestereo.compare.compare import compare
from activestereo.compare.measured_image import MeasuredImage
from activestereo.compare.mismatch import Match
from activestereo.compare.noise import frame_noise_variances, pair_noise_model
from activestereo.compare.nuisances import solve_bounded
from activestereo.compare.render import render_frames
from activestereo.effects import View
from activestereo.report.summary import summary_table, what_is_missed
from lab_worlds import WorldRenderer, error_of_truth
from scipy.optimize import nnls
from virtual_sensor.world import dot_pattern, make_world


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return make_world(tmp_path_factory.mktemp("world"), size=(128, 72), grid=2)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return LayerCache(tmp_path_factory.mktemp("cache"))


@pytest.fixture
def path(world, tmp_path):
    """A copy of the world's capture, to change."""
    return shutil.copytree(world.capture_path, tmp_path / "capture")


def warnings_of(path, world, cache):
    scores = compare(path, renderer=WorldRenderer(world, grid=2), cache=cache).scores
    return scores["warnings"], scores


def test_the_right_world_has_no_warning(world, cache):
    warnings, scores = warnings_of(world.capture_path, world, cache)
    assert warnings == [] and scores["fit"]["at_bound"] == []
    match = scores["match"]
    assert match["pattern"] > 0.8 * match["possible"]
    assert match["geometry"] > 0.6 * match["possible"] > 2 * match["swapped"]


def test_another_pattern_is_said_first(world, cache, path):
    write_gray(path / "pattern.png", dot_pattern(320, 200, 900, 99))
    warnings, scores = warnings_of(path, world, cache)
    assert warnings[0].startswith("the pattern does not match: the rendered dots correlate ")
    assert summary_table(scores).startswith("warning: the pattern does not match")


def test_a_pattern_that_explains_little_is_told(world, cache, path):
    """A pattern whose dots are others in 30 % of its rows."""
    pattern = read_gray(path / "pattern.png").copy()
    foreign = dot_pattern(pattern.shape[1], pattern.shape[0], 900, 99)
    rows = np.arange(len(pattern)) % 40 < 12
    pattern[rows] = foreign[rows]
    write_gray(path / "pattern.png", pattern)
    warnings, scores = warnings_of(path, world, cache)
    match = scores["match"]
    assert 0.5 * match["possible"] < match["pattern"] < 0.75 * match["possible"]
    assert not Match(**match).has_wrong_geometry and not Match(None, None, None, None, ()).has_wrong_geometry
    assert warnings[0].startswith("the pattern explains little: the rendered dots correlate ")


def test_another_scene_is_said_first(world, tmp_path):
    solids = (replace(s, centre=(s.centre[0], s.centre[1] + 0.15, s.centre[2])) for s in world.solids)
    wrong = replace(world, solids=tuple(solids))
    warnings, scores = warnings_of(world.capture_path, wrong, LayerCache(tmp_path / "cache"))
    assert Match(**scores["match"]).has_wrong_geometry
    assert warnings[0].startswith("geometry does not match: at the scene's depth the cameras' dots correlate ")


def test_a_scene_that_no_camera_sees_is_said_first(world, cache, path):
    """All poses are far from the scene."""
    content = json.loads((path / "capture.json").read_text())
    for frame in content["frames"]:
        frame["camera_to_world"][3] += 500.0
    (path / "capture.json").write_text(json.dumps(content))
    warnings, scores = warnings_of(path, world, cache)
    assert warnings[0].startswith("the scene is not where the cameras look") and scores["match"]["geometry"] == 0.0


def test_exchanged_cameras_are_told_from_another_scene(world, cache, path):
    content = json.loads((path / "capture.json").read_text())
    for frame in content["frames"]:
        frame["left"], frame["right"] = frame["right"], frame["left"]
    (path / "capture.json").write_text(json.dumps(content))
    warnings, _ = warnings_of(path, world, cache)
    assert warnings[0].startswith("the cameras are exchanged")


def test_scales_are_those_of_non_negative_least_squares():
    rng = np.random.default_rng(3)
    for truth in ((3.0, -2.0, 5.0), (-1.0, 2.0, 5.0), (-1.0, -2.0, 5.0), (3.0, 2.0, -5.0)):
        columns = np.stack([rng.random(500), rng.random(500), np.ones(500)], axis=1)
        value = columns @ truth + 0.1 * rng.standard_normal(500)
        solution, _, at_bound = solve_bounded(columns.T @ columns, columns.T @ value)
        (a, b, plus, minus), _ = nnls(np.hstack([columns, -columns[:, 2:]]), value)
        np.testing.assert_allclose(solution, [a, b, plus - minus], atol=1e-6)
        scales = zip(("projector_scale", "ambient_scale"), truth[:2], strict=True)
        assert at_bound == tuple(name for name, value in scales if value < 0)


def test_a_scale_at_its_bound_is_told(world, cache, path):
    """A frame that is darker where more of the room's light falls."""
    capture = read_capture(path)
    layers = render_frames(capture, WorldRenderer(world, grid=2), cache=cache)
    for frame in capture.frames:
        for side in ("left", "right"):
            light = layers[frame.id][side].ambient
            darker = 60.0 - 40.0 * light / light.max() + 0.5 * capture.ir(frame, side)
            write_gray(frame.path(side), np.clip(np.rint(darker), 0, 255).astype(np.uint8))
    warnings, scores = warnings_of(path, world, cache)
    assert scores["fit"]["nuisances"]["ambient_scale"] == 0.0 and scores["fit"]["nuisances"]["projector_scale"] > 0.0
    assert warnings[-1].startswith("the ambient scale is at its bound, 0")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "frame 0: more than 50 % of its pixels are at full scale, 255 DN: leave it out"),
        ({"repeat_group": 0}, "the frames of repeat_group 0 vary by "),
        ({"depth": "depth.png", "depth_scale": 1.0}, "the device's depth is "),
    ],
)
def test_a_recording_that_is_not_as_stated_is_told(world, cache, path, change, words):
    content = json.loads((path / "capture.json").read_text())
    for frame in content["frames"]:
        frame.update(change)
    (path / "capture.json").write_text(json.dumps(content))
    write_gray(path / "depth.png", np.full((72, 128), 900, np.uint16))  # millimetres
    if not change:
        write_gray(path / content["frames"][0]["left"], np.full((72, 128), 255, np.uint8))
    warnings, scores = warnings_of(path, world, cache)
    assert any(text.startswith(words) for text in warnings), warnings
    assert not any("nothing is missing" in text for text in what_is_missed(scores))


@pytest.mark.parametrize(("factor", "words"), [(2.0, "0.5 times"), (0.5, "2 times")])
def test_frames_of_another_exposure_than_stated_are_told(world, cache, path, factor, words):
    content = json.loads((path / "capture.json").read_text())
    for frame in content["frames"][2:4]:
        frame["exposure_s"] *= factor
    (path / "capture.json").write_text(json.dumps(content))
    warnings, _ = warnings_of(path, world, cache)
    assert any(re.match(f"frame 2 and 3: its dots are {words}", text) for text in warnings), warnings


def nudged(dn):
    return 0.6 * dn + 0.4 * np.roll(dn, 1, axis=1)


def dimmed_in_a_place(dn):
    return dn * np.where(np.mgrid[:72, :128].max(axis=0) // 32 == 1, 0.6, 1.0)


@pytest.mark.parametrize(("change", "words"), [(nudged, "lie 0.[2-6]"), (dimmed_in_a_place, "differ in a place")])
def test_repeats_that_moved_or_changed_in_a_place_are_told(world, cache, path, change, words):
    frame = read_capture(path).repeats()[0][1]
    for side in ("left", "right"):
        write_gray(frame.path(side), np.rint(change(read_gray(frame.path(side)).astype(float))).astype(np.uint8))
    warnings, _ = warnings_of(path, world, cache)
    assert len(warnings) == 1 and re.match(f"the frames of repeat_group 0 {words}", warnings[0])


def test_a_pair_without_repeats_tells_its_noise(world, cache, path):
    content = json.loads((path / "capture.json").read_text())
    for frame in content["frames"]:
        frame["repeat_group"] = None
    (path / "capture.json").write_text(json.dumps(content))
    _, scores = warnings_of(path, world, cache)
    capture = read_capture(path)
    assert frame_noise_variances(capture, 4.0) == ({}, None) and "   pair" in summary_table(scores)
    for split in ("train", "test"):
        score = scores["ir"][split]
        assert score["noise_floor_from"] == ["pair"]
        assert score["noise_floor_dn"] == pytest.approx(error_of_truth(world, capture, split), rel=0.3)


def test_a_pair_without_a_smooth_place_tells_nothing(world, cache):
    capture = read_capture(world.capture_path)
    layers = render_frames(capture, WorldRenderer(world, grid=2), cache=cache)
    frame = capture.frames[0]
    black = np.zeros((72, 128), np.uint8)
    left, right = (
        MeasuredImage(frame, side, View.of(capture, frame, side, seen), seen, black)
        for side, seen in layers[frame.id].items()
    )
    assert pair_noise_model([(left, right)], 5.0) is None
