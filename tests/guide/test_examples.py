# SPDX-License-Identifier: Apache-2.0
"""The examples of robot loops run, small."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_mujoco_wrist(tmp_path):
    pytest.importorskip("mujoco", reason="the package mujoco is not installed (pip install mujoco)")
    good_share = load(EXAMPLES / "mujoco_wrist/mujoco_wrist.py").run(tmp_path, pictures=2, scale=0.25, samples=16)
    assert good_share > 0.6
    assert (tmp_path / "mujoco_wrist.png").stat().st_size > 1000


@pytest.mark.parametrize("simulator", ["newton", "mujoco", "mujoco_warp"])  # Genesis compiles for a minute
def test_gbuffers(simulator):
    pytest.importorskip(simulator, reason=f"the package {simulator} is not installed (pip install {simulator})")
    pictures, share = load(EXAMPLES / "gbuffers/play.py").run(simulator)
    assert [picture.image.shape for picture in pictures] == [(120, 212)] * 3 and share > 0.8


def test_sapien_sensor(tmp_path):
    pytest.importorskip("sapien", reason="the package sapien is not installed (pip install sapien)")
    good_share = load(EXAMPLES / "sapien_sensor/sapien_sensor.py").run(tmp_path, scale=0.25, samples=4, steps=150)
    assert good_share > 0.6
    assert (tmp_path / "sapien_sensor.png").stat().st_size > 1000


def test_mani_skill_depth(tmp_path):
    pytest.importorskip("mani_skill", reason="the package mani_skill is not installed (pip install mani_skill)")
    try:
        good_share = load(EXAMPLES / "mani_skill_depth/mani_skill_depth.py").run(
            tmp_path, "PickCube-v1", size=96, samples=4, steps=1
        )
    except RuntimeError as error:
        pytest.skip(f"SAPIEN has no renderer here, which ManiSkill's cameras need: {error}")
    assert good_share > 0.6
    assert (tmp_path / "mani_skill_depth.png").stat().st_size > 1000


def test_any_simulator(tmp_path):
    good_share = load(EXAMPLES / "any_simulator/any_simulator.py").run(tmp_path, environments=2, pictures=2, samples=4)
    assert good_share > 0.6
    assert (tmp_path / "any_simulator.png").stat().st_size > 1000


def test_grasp_task(tmp_path):
    assert load(EXAMPLES / "grasp_task/grasp_task.py").run(tmp_path, environments=3, samples=1) > 0.95
    assert (tmp_path / "grasp_task.png").stat().st_size > 1000


def test_train_depth_policy(tmp_path, monkeypatch):
    """A network that says what it is taught acts as the teacher does; a whole run, of one step of training, writes its
    results."""
    pytest.importorskip("torch", reason="the package torch is not installed (pip install torch)")
    pytest.importorskip("cv2", reason="OpenCV is not installed (pip install opencv-python-headless)")
    monkeypatch.syspath_prepend(EXAMPLES.parent / "tests/bench/depth_policy")
    example = load(EXAMPLES.parent / "tests/bench/depth_policy/train_depth_policy.py")
    world = example.GraspWorld(8, "clean", size_px=32)
    depth = world.reset()

    class Knowing(example.Policy):
        def forward(self, _):
            return example.torch.from_numpy(example.targets(world.offsets()))

    np.testing.assert_allclose(Knowing().act(depth), example.teacher(world), atol=1e-5)
    monkeypatch.setattr(example, "foreign_renderers", lambda: ["ours"])
    results = example.run(tmp_path, ["raster"], train_episodes=2, test_episodes=2, epochs=1, environments=2)
    assert results["raster"]["ours"][1] == 2 and (tmp_path / "results.json").exists()
    assert example.interval(30, 40) == pytest.approx((0.5981, 0.8581), abs=1e-4)


def test_mitsubas_wrist_camera_sees_what_ours_does(tmp_path, monkeypatch):
    pytest.importorskip("mitsuba", reason="the package mitsuba is not installed (pip install mitsuba)")
    pytest.importorskip("cv2", reason="OpenCV is not installed (pip install opencv-python-headless)")
    monkeypatch.syspath_prepend(EXAMPLES.parent / "tests/bench/depth_policy")
    foreign = load(EXAMPLES.parent / "tests/bench/depth_policy/foreign_worlds.py")
    mitsuba, clean = foreign.foreign_world(2, 4, "mixed", "mitsuba"), foreign.GraspWorld(2, "clean", seed=4)
    depth, truth = mitsuba.reset(seed=7), clean.reset(seed=7)
    assert (np.abs(depth - truth) < 0.01).mean() > 0.6
    np.testing.assert_array_equal(mitsuba.reset(seed=7), depth)
    load(EXAMPLES.parent / "tests/bench/depth_policy/episodes.py").film(
        tmp_path / "episodes.gif", {"still": lambda seen: np.zeros((len(seen), 4))}, 1, 3, "hard"
    )
    with Image.open(tmp_path / "episodes.gif") as film:
        assert film.n_frames == 11
