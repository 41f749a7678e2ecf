# SPDX-License-Identifier: Apache-2.0
"""A data set in other formats has the same depth, in their units."""

import json
from pathlib import Path

import numpy as np
import pytest

from activestereo.benchmarks.generate import bop, formats
from activestereo.benchmarks.generate.bop import stored_frames
from activestereo.benchmarks.generate.studio import Frame
from activestereo.cli import generate as command
from activestereo.cli import main

_K = np.array([[50.0, 0.0, 31.5], [0.0, 50.0, 23.5], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def data_set(tmp_path_factory) -> Path:
    """Two frames of noise, the second one's camera 0.5 m above the first's."""
    out, random = tmp_path_factory.mktemp("set"), np.random.default_rng(0)
    for number in range(2):
        rgb, gray = (random.integers(0, 256, (48, 64, *more), np.uint8) for more in ((3,), ()))
        depth = np.rint(random.uniform(0.3, 3.0, (48, 64)) * 1000.0).astype(np.float32) / 1000.0
        world_to_camera = np.eye(4)
        world_to_camera[1, 3] = 0.5 * number
        confidence, reason = np.zeros((48, 64), np.float32), np.zeros((48, 64), np.uint8)
        images = rgb, gray, gray, depth, depth, confidence, reason
        bop.write_frame(out, Frame(number, *images, _K, world_to_camera, ()))
    lens = {"cam_K": _K.ravel().tolist(), "distortion": [0.0] * 5}
    (out / "ir_cameras.json").write_text(json.dumps({"ir_left": lens, "ir_right": lens, "baseline_m": 0.05}))
    return out


def test_lerobot_gets_depth_maps_in_millimetres_and_an_episode_for_each_frame(data_set, tmp_path, monkeypatch):
    calls = []

    class Recorder:
        @classmethod
        def create(cls, name, fps, features, **options):
            calls.append(features)
            return cls()

        def add_frame(self, frame):
            calls.append(frame)

        def save_episode(self):
            calls.append("episode")

        def finalize(self):
            calls.append("end")

    monkeypatch.setattr(formats, "lerobot_package", lambda: Recorder)
    formats.write_lerobot(data_set, 2, tmp_path / "to")
    features, first, *_ = calls
    assert [call for call in calls if isinstance(call, str)] == ["episode", "episode", "end"]
    depth = features["observation.images.depth"]
    assert depth["info"] == {"is_depth_map": True} and depth["shape"] == (48, 64, 1)
    stored = list(stored_frames(data_set, 2))
    assert first["observation.images.depth"].dtype == np.uint16
    assert (first["observation.images.depth"][..., 0] == stored[0].depth_mm).all()
    assert np.allclose(calls[3]["observation.state"], [0, -0.5, 0, 0, 0, 0, 1])
    assert set(first) - {"task"} == set(features)


def test_lerobots_package_reads_the_same_depth(data_set, tmp_path):
    data = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="the package lerobot is not installed")
    formats.write_lerobot(data_set, 2, tmp_path / "to")
    found = data.LeRobotDataset(f"activestereo/{data_set.name}", root=tmp_path / "to")
    for frame, read in zip(stored_frames(data_set, 2), found, strict=True):
        assert (read["observation.images.depth"].numpy()[0] == frame.depth_mm).all()


def test_mcap_has_a_cameras_topics_with_their_geometry(data_set, tmp_path):
    highlevel = pytest.importorskip("rosbags.highlevel", reason="the package rosbags is not installed")
    formats.write_formats(data_set, 2, ["mcap"])
    with highlevel.AnyReader([data_set / "mcap"]) as reader:
        found = {c.topic: reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()}
    depth = found["/camera/aligned_depth_to_color/image_raw"]
    assert depth.encoding == "16UC1"
    last = list(stored_frames(data_set, 2))[1]
    assert (depth.data.view(np.uint16).reshape(48, 64) == last.depth_mm).all()
    assert found["/camera/infra2/camera_info"].p[3] == pytest.approx(-50.0 * 0.05)
    assert found["/camera/pose"].pose.position.y == pytest.approx(-0.5)


def test_what_is_missing_is_said_before_anything_is_made(tmp_path, monkeypatch, capsys):
    def package():
        raise ImportError("rosbags is missing: pip install rosbags")

    monkeypatch.setitem(formats.FORMATS, "mcap", (package, None))
    assert tuple(formats.FORMATS) == command.FORMATS
    options = ["generate", "no.glb", "--count", "1", "--out", str(tmp_path / "set"), "--also", "mcap"]
    assert main(options) == 2
    assert "pip install rosbags" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
