# SPDX-License-Identifier: Apache-2.0
"""Every command that a command's end gives to paste runs as it stands, and leads on in its turn."""

import shutil

import numpy as np
import pytest
from PIL import Image

from activestereo.capture.capture import read_capture
from activestereo.capture.images import read_gray, write_gray
from activestereo.cli import simulate
from activestereo.scene_io import meshes
from activestereo.scene_io.gltf_writer import GltfWriter
from command_line import led_on, run_here
from room_worlds import BASELINE_M, CX, CY, F, Room

_QUICK = ("--device", "cpu", "--spp", "1")
_CLEAR = ("--device", "cpu", "--spp", "64")  # a diagnosis with fewer takes the renderer's noise for an effect
_PATIENCE_S = 500


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Odd letters stay in the names of files."""
    return tmp_path_factory.mktemp("a user's")


@pytest.fixture(scope="module")
def capture(folder, depth_capture):
    return shutil.copytree(depth_capture, folder / "table")


@pytest.fixture(scope="module")
def scene(folder):
    writer = GltfWriter()
    writer.add_mesh("cube", meshes.box(0.05, 0.05, 0.05), writer.add_material("grey"))
    writer.write(folder / "cube.glb")
    return folder / "cube.glb"


@pytest.fixture(autouse=True)
def rough_pictures(monkeypatch):
    """A sample a pixel is enough here, whatever the words say, and no charts: both have tests of their own."""

    def with_one_sample(*given):
        config = simulate_config(*given)
        config.samples_per_pixel = 1
        return config

    simulate_config = simulate.make_config
    monkeypatch.setattr(simulate, "make_config", with_one_sample)
    for module in ("comparison", "first_screen"):
        monkeypatch.setattr(f"activestereo.report.{module}.chart", lambda figure, alt: alt)


@pytest.fixture
def quick(monkeypatch):
    """Few samples where a command without --spp would take many."""
    for module in ("compare.compare", "compare.engine_prediction", "diagnose.diagnosis"):
        monkeypatch.setattr(f"activestereo.{module}.usual_samples", lambda _: 2)
    monkeypatch.setattr("activestereo.effects.engines.base_layers.SQUARES", 1)


def _kind(words):
    """A command without its paths: its name, and the options that are given."""
    name = words[:2] if words[0] in ("calibrate", "model") else words[:1]
    told = ("--model", "--effects")
    return " ".join([*name, *sorted(word for word in words if word in told)])


def _follow(capsys, *seed):
    """The kinds of commands that a command leads to; led_on() views, each other kind is run once, as pasted."""
    waiting, done = [[str(word) for word in seed]], []
    while waiting:
        words = waiting.pop(0)
        if _kind(words) in done or words[0] == "view":
            continue
        end = run_here(capsys, *words, patience_s=_PATIENCE_S)
        assert end.returncode == 0, (words, end.stderr)
        done.append(_kind(words))
        if done[-1] != "model show":  # a table is its end
            leads = led_on(end.stdout)
            assert all(lead[0] == "view" or set(_QUICK + _CLEAR) & set(words) <= set(lead) for lead in leads), leads
            waiting += leads
    return done


def test_from_a_comparison_to_a_sensor_with_what_was_found(capsys, folder, capture):
    kinds = _follow(capsys, "compare", capture, *_CLEAR, "-o", folder / "compare")
    assert kinds[:4] == ["compare", "diagnose", "compare --model", "simulate --model"]
    [simulated] = (folder / "compare").rglob("ir_left.png")  # under the capture's own light
    frame = read_capture(capture).frames[0]
    light = [float(read_gray(path).mean()) for path in (simulated, frame.left_path)]
    assert light[0] == pytest.approx(light[1], rel=0.03)
    depth = [read_gray(path) > 0 for path in (simulated.with_name("depth.png"), frame.depth_path)]
    assert depth[0].mean() > 0.9 * depth[1].mean()


def test_from_views_of_a_room_to_its_model_beside_it(capsys, folder, quick, monkeypatch):
    """Under a model, too, a room's own light is rendered once: effects act on its images, as they are diagnosed."""

    def refuse(*_):
        raise AssertionError("a measured room needs no engine")

    monkeypatch.setattr("activestereo.compare.engine_prediction.CaptureRenderer", refuse)
    views = Room(turns_deg=((0, 0), (14, 3)), exposures=(1.0, 0.85)).write(folder / "views")
    stated = ("--sensor", "d415", "--k", f"{F},{F},{CX},{CY}", "--baseline", BASELINE_M, "--depth-scale", "0.0001")
    kinds = _follow(capsys, "import", views, *stated, "-o", folder / "room")
    assert kinds[:4] == ["import", "calibrate world", "diagnose", "compare"] and "compare --model" in kinds


def test_from_scenes_to_pictures(capsys, folder, scene):
    assert _follow(capsys, "simulate", scene, *_QUICK, "--resolution", "106x60", "-o", folder / "out") == ["simulate"]
    writer = GltfWriter()
    writer.add_mesh("cube", meshes.box(80.0, 80.0, 80.0), writer.add_material("grey"))
    writer.write(folder / "millimetres.glb")
    few = (*_QUICK, "--resolution", "106x60")
    first = ("simulate", folder / "millimetres.glb", *few, "-o", folder / "a")
    [again] = led_on(run_here(capsys, *first).stdout)
    assert again == [*map(str, first), "--unit", "0.001"]
    assert "have depth" in run_here(capsys, *again).stdout
    small = ("--rgb-size", "64x48", "--ir-size", "106x60")
    assert _follow(capsys, "generate", scene, *_QUICK, "--count", "1", *small, "-o", folder / "set") == ["generate"]


def test_from_a_recording_to_a_simulation_of_what_it_shows(capsys, folder):
    recording, rng = folder / "tum", np.random.default_rng(0)
    for kind in ("rgb", "depth"):
        (recording / kind).mkdir(parents=True)
        (recording / f"{kind}.txt").write_text(f"1.0 {kind}/0.png\n")
    Image.fromarray(rng.integers(0, 255, (24, 32, 3), np.uint8)).save(recording / "rgb/0.png")
    write_gray(recording / "depth/0.png", rng.integers(4000, 4100, (24, 32)).astype(np.uint16))
    kinds = _follow(capsys, "import", recording, "--k", "30,31,15.5,11.5", "-o", folder / "rec")
    assert kinds == ["import", "calibrate scene", "simulate"]


def test_from_a_recording_to_its_depth(capsys, folder):
    recording, rng = folder / "pairs", np.random.default_rng(0)
    for number in range(2):
        wall = rng.integers(20, 200, (48, 76), np.uint8)
        for side, own in (("left", wall[:, :64]), ("right", wall[:, 12:])):
            (recording / side).mkdir(parents=True, exist_ok=True)
            write_gray(recording / side / f"{number}.png", own)
    stated = ("--k", "100,100,31.5,23.5", "--baseline", "0.06", "--max-disparity", "16")
    kinds = _follow(capsys, "depth", recording, *stated, "-o", folder / "matched")
    assert kinds == ["depth"]


def test_from_a_calibration_to_what_a_model_says(capsys, folder):
    repeats, rng = folder / "repeats", np.random.default_rng(0)
    repeats.mkdir()
    level = np.broadcast_to(np.linspace(20.0, 160.0, 40), (30, 40))
    for number in range(12):
        write_gray(repeats / f"{number:02d}.png", rng.poisson(level).astype(np.uint8))
    kinds = _follow(capsys, "calibrate", "noise", repeats, "-o", folder / "model.json")
    assert kinds == ["calibrate noise", "model show"]
