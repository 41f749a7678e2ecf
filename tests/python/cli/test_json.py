# SPDX-License-Identifier: Apache-2.0
"""Every command that prints a table prints JSON in its place where --json is given, and nothing else on that stream."""

import json

import numpy as np
import pytest

from activestereo.cli import arguments, main
from activestereo.scene_io.example_scene import CAMERA_TO_WORLD
from command_line import leaves

WITHOUT_TABLES = {"demo", "view", "add", "import", "generate", "calibrate scene"}
K = ("--k", "120,120,79.5,47.5", "--baseline", "0.05")


@pytest.fixture
def said(capsys):
    def run(*words):
        assert main([*map(str, words), "--json"]) == 0
        return json.loads(capsys.readouterr().out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))

    return run


def test_all_commands_that_print_tables_have_the_option():
    without = {name for name, parser in leaves().items() if "--json" not in parser._option_string_actions}
    assert without == WITHOUT_TABLES


def test_devices_effects_and_presets(said, device):
    effects = {entry["id"]: entry for entry in said("effect", "list")}
    sigma = effects["lens_psf"]["parameters"][0]
    assert sigma["name"] == "sigma_px" and sigma["low"] < sigma["high"]
    assert [camera["name"] for camera in said("presets", "d435")] == ["D435"]


def test_models(said, tmp_path, capsys):
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    assert main(["add", "vignetting", "--set", "exponent=3", "-o", str(first)]) == 0
    assert main(["add", "vignetting", "--set", "exponent=4", "-o", str(second)]) == 0
    capsys.readouterr()
    shown = said("model", "show", first, second)
    assert [m["effects"][0]["parameters"]["exponent"]["value"] for m in shown] == [3.0, 4.0]


def test_noise_of_a_calibration(said, tmp_path):
    rng = np.random.default_rng(2)
    stack = np.rint(np.clip(rng.normal(np.linspace(20.0, 60.0, 64), 2.0, (12, 12, 64)), 0.0, 255.0))
    np.save(tmp_path / "stack.npy", stack.astype(np.uint8))
    imager = said("calibrate", "noise", tmp_path / "stack.npy", "-o", tmp_path / "model.json")
    assert imager == json.loads((tmp_path / "model.json").read_text())["imager"]


def test_depth_and_pair(said, pair, tmp_path):
    images = pair / "left.png", pair / "right.png"
    found = said("depth", *images, *K, "--max-disparity", 32, "--out", tmp_path / "depth")
    assert found["median_depth_m"] == pytest.approx(0.5, abs=0.01) and found["measured_share"] > 0.7
    assert found["matching"]["max_disparity"] == 32 and found["stages_ms"]["depth"] and found["hints"] == []
    found = said("pair", *images, *K, "--out", tmp_path / "pair")
    assert found == json.loads((tmp_path / "pair/pair.json").read_text()) and found["findings"]


def test_simulate(said, table_top, tmp_path):
    options = ("--resolution", "106x60", "--spp", 1, "--max-bounces", 0, "--out", tmp_path)
    found = said("simulate", table_top, *options)
    assert "all" in [row["name"] for row in found["accuracy"]] and len(found["stages_ms"]) >= 2
    assert found["matching"]["subpixel"] == "lucas_kanade"
    camera = json.loads((tmp_path / "camera.json").read_text())
    assert camera == found["camera"] and camera["baseline_m"] == pytest.approx(0.05, abs=2e-3)
    left, right = (camera["cameras"][f"ir_{side}"] for side in ("left", "right"))
    offset = np.linalg.inv(left["camera_to_world"]) @ np.array(right["camera_to_world"])
    assert offset[:3, 3] == pytest.approx([camera["baseline_m"], 0.0, 0.0], abs=1e-6)
    assert (left["width"], left["distortion_model"]) == (106, "brown_conrady")
    assert np.allclose(camera["cameras"]["rgb"]["camera_to_world"], CAMERA_TO_WORLD, atol=1e-6)


def test_diagnose(said, tmp_path):
    """A capture without infrared images has an answer, too, and a report."""
    (tmp_path / "capture.json").write_text(json.dumps({"frames": [{"left": None, "right": None}]}))
    answer = said("diagnose", tmp_path, "--out", tmp_path / "out")
    assert answer["verdict"] == "undetermined" and answer == json.loads((tmp_path / "out/diagnose.json").read_text())
    assert "This data cannot tell what is missing" in (tmp_path / "out/report.html").read_text()


def test_numbers_that_json_cannot_write_are_null(capsys):
    arguments.print_json({"a": [float("nan"), (1.0, float("inf"))]})
    assert json.loads(capsys.readouterr().out) == {"a": [None, [1.0, None]]}
