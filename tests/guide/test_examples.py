# SPDX-License-Identifier: Apache-2.0
"""The examples of robot loops run, small."""

import importlib.util
from pathlib import Path

import pytest

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
