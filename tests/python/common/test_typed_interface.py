# SPDX-License-Identifier: Apache-2.0
"""A type checker sees misspelt fields, keys and methods, and values of a wrong type, before a program runs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
# Each line with a mistake ends in "# wrong".
SCRIPT = """\
# pyright: strict
from pathlib import Path

import numpy as np

from activestereo import GBufferStereo, StereoDepthSensor, StereoDepthSensorConfig
from activestereo.common.pose import Pose

SCENE = Path("table_top.gltf")


def picture() -> float:
    config = StereoDepthSensorConfig("D435").scaled(0.5)
    config.samples_per_pixel = 2
    config.samples_per_pixle = 4  # wrong
    config.laser_power_mw = "full"  # wrong
    config.emitter = "blinking"  # wrong
    config.subpixel = "parabola"
    sensor = StereoDepthSensor(config, SCENE, pose=Pose())
    sensor.take_picture()
    sensor.compute_depth()
    depth_m = sensor.get_depth()
    left, right = sensor.get_ir_measured()
    print(left.shape, right.shape)
    print(sensor.get_pontcloud())  # wrong
    return float(depth_m.mean())


def batch() -> float:
    sensor = GBufferStereo("D435", environments=4)
    depth_m = np.full(sensor.shape, 0.8)
    albedo = np.full(sensor.shape, 0.5)
    frame = sensor(depth=depth_m, albedo=albedo, outputs=["depth", "valid"])
    share = frame["valid"].mean()
    print(frame["dpeth"].min())  # wrong
    return float(share)


if __name__ == "__main__":
    print(picture(), batch())
"""


# The script's types need none of these, which take mypy five sixths of the time.
SKIPPED = ["matplotlib.*", "scipy.*", "activestereo.lab"]
SKIPPED += [f"activestereo.{name}.*" for name in ("calibrate", "compare", "diagnose", "effects", "model", "report")]
SETTINGS = f"[mypy]\nignore_missing_imports = True\n[mypy-{','.join(SKIPPED)}]\nfollow_imports = skip\n"


@pytest.mark.parametrize("checker", ["mypy", "pyright", "basedpyright"])
def test_planted_mistakes_are_the_only_ones(tmp_path, checker):
    if shutil.which(checker) is None:
        pytest.skip(f"{checker} is not installed: pip install {checker}")
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    (tmp_path / "mypy.ini").write_text(SETTINGS)
    options = [] if checker == "mypy" else ["--pythonpath", sys.executable]
    paths = {"PYTHONPATH": str(ROOT / "python")}
    run = subprocess.run(
        [checker, *options, script], capture_output=True, text=True, cwd=tmp_path, env=os.environ | paths
    )
    told = [line for line in run.stdout.splitlines() if "script.py:" in line and "error" in line]
    wrong = [number for number, line in enumerate(SCRIPT.splitlines(), 1) if line.endswith("# wrong")]
    assert sorted({int(line.split(":")[1]) for line in told}) == wrong and len(wrong) == 5, run.stdout + run.stderr
