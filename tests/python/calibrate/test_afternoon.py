# SPDX-License-Identifier: Apache-2.0
"""The page from a real camera to its model, followed on a practice recording, finds the recording's truth."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "examples/real_camera/README.md"

pytestmark = pytest.mark.skipif(
    not os.environ.get("ACTIVESTEREO_FULL"), reason="it takes minutes: ACTIVESTEREO_FULL=1 runs it"
)


def commands():
    text = "\n".join(re.findall(r"^```sh\n(.*?)^```$", PAGE.read_text(), re.DOTALL | re.MULTILINE))
    lines = text.replace("\\\n", " ").splitlines()
    return [shlex.split(re.sub(r"^PYTHONPATH=\S+ ", "", line)) for line in lines if line.strip()]


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("afternoon")
    (folder / "examples").symlink_to(ROOT / "examples")
    (folder / "out").mkdir()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    for words in commands():
        if "--views" in words:  # a recording of the reader's own
            continue
        if words[0] == "activestereo":
            words = [sys.executable, "-m", *words]
            if words[3] == "compare":
                words += ["--spp", "16"]
        elif "practice_recording.py" in words[1]:
            words += ["--samples", "8", "--poses", "4"]
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout}\n{done.stderr}"
    truth = json.loads((folder / "out/practice/truth.json").read_text())
    return folder / "out", truth, json.loads((folder / "out/model.json").read_text())


def test_the_model_is_the_camera(followed):
    _, truth, model = followed
    left = np.reshape(model["rig"]["left"]["K"], (3, 3))
    assert left[0, 0] == pytest.approx(truth["focal_px"], rel=3e-3)
    place = np.linalg.inv(np.reshape(model["rig"]["left_to_projector"], (4, 4)))[:3, 3]
    assert np.abs(place - truth["projector_place_m"]).max() < 5e-4
    assert model["imager"]["shot"]["value"] == pytest.approx(truth["shot_dn"], rel=0.05)
    assert model["nuisances"]["black_dn"]["value"] == pytest.approx(truth["black_dn"], abs=0.05)


def test_the_camera_stands_where_it_stood_on_the_gripper(followed):
    out, truth, _ = followed
    hand = np.reshape(json.loads((out / "model.hand_eye.json").read_text())["camera_to_gripper"], (4, 4))
    apart = np.linalg.inv(hand) @ np.reshape(truth["camera_to_gripper"], (4, 4))
    assert np.linalg.norm(apart[:3, 3]) < 2e-3
    assert np.rad2deg(np.arccos(np.clip((np.trace(apart[:3, :3]) - 1) / 2, -1, 1))) < 0.1


def test_the_reports_are_there(followed):
    out, truth, model = followed
    assert model["materials"]["box"]["ir_albedo"]["value"] == pytest.approx(truth["box_ir_albedo"], abs=0.12)
    for name in ("compare/report.html", "simulated/depth.png"):
        assert (out / name).stat().st_size > 1000
