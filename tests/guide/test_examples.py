# SPDX-License-Identifier: Apache-2.0
"""The examples of robot loops run, small, and the gallery's page is that of its tiles."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(folder, name, *arguments, least_good_share=0.6, **options):
    """Runs an example, which draws a picture; most of its measured pixels are good."""
    assert load(EXAMPLES / f"{name}/{name}.py").run(folder, *arguments, **options) > least_good_share
    assert (folder / f"{name}.png").stat().st_size > 1000


def test_mujoco_wrist(tmp_path):
    pytest.importorskip("mujoco", reason="the package mujoco is not installed (pip install mujoco)")
    run(tmp_path, "mujoco_wrist", pictures=2, scale=0.25, samples=16)


@pytest.mark.parametrize("simulator", ["newton", "mujoco", "mujoco_warp"])  # Genesis compiles for a minute
def test_gbuffers(simulator):
    pytest.importorskip(simulator, reason=f"the package {simulator} is not installed (pip install {simulator})")
    pictures, share = load(EXAMPLES / "gbuffers/play.py").run(simulator)
    assert [image.shape for _, image, _ in pictures] == [(120, 212)] * 3 and share > 0.8


def test_sapien_sensor(tmp_path):
    pytest.importorskip("sapien", reason="the package sapien is not installed (pip install sapien)")
    run(tmp_path, "sapien_sensor", scale=0.25, samples=4, steps=150)


def test_mani_skill_depth(tmp_path):
    pytest.importorskip("mani_skill", reason="the package mani_skill is not installed (pip install mani_skill)")
    try:
        run(tmp_path, "mani_skill_depth", "PickCube-v1", size=96, samples=4, steps=1)
    except RuntimeError as error:
        pytest.skip(f"SAPIEN has no renderer here, which ManiSkill's cameras need: {error}")


def test_any_simulator(tmp_path):
    run(tmp_path, "any_simulator", environments=2, pictures=2, samples=4)


def test_grasp_task(tmp_path):
    run(tmp_path, "grasp_task", least_good_share=0.95, environments=3, samples=1)


def test_the_gallery_s_page_is_what_its_tiles_say():
    check = subprocess.run([sys.executable, EXAMPLES / "gallery/gallery.py", "--check"])
    assert check.returncode == 0, "run examples/gallery/gallery.py --only NAME, with the names of new tiles"
