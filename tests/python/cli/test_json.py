# SPDX-License-Identifier: Apache-2.0
"""Every command that prints a table prints JSON in its place where --json is given, and nothing else on that stream."""

import json

import numpy as np
import pytest

from activestereo.capture.images import write_gray
from activestereo.cli import arguments, main
from command_line import leaves

TABLES = {
    "simulate", "presets", "depth", "pair", "depth-quality", "compare", "diagnose", "capture check", "effect list",
    "effect measure", "benchmark sim-to-real run", "benchmark sim-to-real score", "benchmark sim-to-real ablate",
    "cache list", "devices", "doctor",
}  # fmt: skip
K = ("--k", "120,120,79.5,47.5", "--baseline", "0.05")


@pytest.fixture
def said(capsys):
    def run(*words):
        assert main([*map(str, words), "--json"]) == 0
        return json.loads(capsys.readouterr().out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))

    return run


@pytest.fixture
def pair(tmp_path):
    wide = np.random.default_rng(1).integers(0, 256, (96, 172), dtype=np.uint8)
    write_gray(tmp_path / "left.png", wide[:, :160].copy())
    write_gray(tmp_path / "right.png", wide[:, 12:].copy())
    return tmp_path / "left.png", tmp_path / "right.png"


def test_commands_with_tables_have_the_option():
    assert {name for name, parser in leaves().items() if "--json" in parser._option_string_actions} == TABLES


def test_devices_effects_and_presets(said, device):
    assert device.info.name in [entry["name"] for entry in said("devices")]
    effects = {entry["id"]: entry for entry in said("effect", "list")}
    sigma = effects["lens_psf"]["parameters"][0]
    assert sigma["name"] == "sigma_px" and sigma["low"] < sigma["high"]
    assert [camera["name"] for camera in said("presets", "d435")] == ["D435"]


def test_depth_pair_and_depth_quality(said, pair, tmp_path):
    found = said("depth", *pair, *K, "--max-disparity", 32, "--out", tmp_path / "depth")
    assert found["median_depth_m"] == pytest.approx(0.5, abs=0.01) and found["measured_share"] > 0.7
    assert found["matching"]["max_disparity"] == 32 and found["stages_ms"]["depth"] and found["hints"] == []
    found = said("pair", *pair, *K, "--out", tmp_path / "pair")
    assert found == json.loads((tmp_path / "pair/pair.json").read_text()) and found["findings"]
    found = said("depth-quality", tmp_path / "depth/depth.npy", *K, "--out", tmp_path / "q.json")
    assert found == json.loads((tmp_path / "q.json").read_text())
    assert found["frames"] == 1 and found["temporal_noise_percent"] is None


def test_simulate(said, table_top, tmp_path):
    options = ("--resolution", "106x60", "--spp", 1, "--max-bounces", 0, "--out", tmp_path)
    found = said("simulate", table_top, *options)
    assert "all" in [row["name"] for row in found["accuracy"]] and len(found["stages_ms"]) >= 2


def test_diagnose(said, tmp_path, monkeypatch):
    """A capture without infrared images has an answer, too, and a report."""
    (tmp_path / "capture.json").write_text(json.dumps({"frames": [{"left": None, "right": None}]}))
    answer = said("diagnose", tmp_path, "--out", tmp_path / "out")
    assert answer["verdict"] == "undetermined" and answer == json.loads((tmp_path / "out/diagnose.json").read_text())
    assert "This data cannot tell what is missing" in (tmp_path / "out/report.html").read_text()


def test_numbers_that_json_cannot_write_are_null(capsys):
    arguments.print_json({"a": [float("nan"), (1.0, float("inf"))]})
    assert json.loads(capsys.readouterr().out) == {"a": [None, [1.0, None]]}
