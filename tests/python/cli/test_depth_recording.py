# SPDX-License-Identifier: Apache-2.0
"""'activestereo depth RECORDING': a folder's pairs under advanced-mode settings, interrupted and gone on with."""

import json

import numpy as np
import pytest
from PIL import Image

import activestereo.camera.advanced_mode.matcher as matcher_module
from activestereo.cli import main

_F_PX, _BASELINE_M, _SHIFT_PX = 100.0, 0.06, 12
_DEPTH_M = _F_PX * _BASELINE_M / _SHIFT_PX
_GEOMETRY = ["--k", f"{_F_PX},{_F_PX},63.5,47.5", "--baseline", str(_BASELINE_M)]


@pytest.fixture
def recording(tmp_path):
    """Three pairs of one wall, at a known disparity."""
    folder = tmp_path / "recording"
    (folder / "left").mkdir(parents=True)
    (folder / "right").mkdir()
    rng = np.random.default_rng(1)
    for number in range(3):
        wall = rng.integers(20, 200, (96, 128 + _SHIFT_PX), np.uint8)
        Image.fromarray(wall[:, :128]).save(folder / "left" / f"{number}.png")
        Image.fromarray(wall[:, _SHIFT_PX:]).save(folder / "right" / f"{number}.png")
    return folder


def settings(path, **values):
    path.write_text(json.dumps({name.replace("_", "-"): value for name, value in values.items()}))
    return str(path)


def depth(recording, out, *more):
    return main(["depth", str(recording), *_GEOMETRY, "--out", str(out), "--max-disparity", "32", *more])


def values(path):
    image = np.asarray(Image.open(path))
    return np.median(image[image > 0])


def test_depth_has_the_settings_units_and_the_recording_stays(recording, tmp_path, capsys):
    before = {path: path.read_bytes() for path in recording.rglob("*.png")}
    file = settings(tmp_path / "s.json", param_depthunits="100", param_lambdaad="1")
    assert depth(recording, tmp_path / "out", "--settings", file) == 0
    assert values(tmp_path / "out/000002.png") == pytest.approx(1e4 * _DEPTH_M, abs=60)
    assert "without effect here: param-lambdaad" in capsys.readouterr().out
    assert {path: path.read_bytes() for path in recording.rglob("*.png")} == before
    assert depth(recording, tmp_path / "d", "--settings", settings(tmp_path / "d.json", param_disparitymode=1)) == 0
    assert values(tmp_path / "d/000000.png") == pytest.approx(32 * _SHIFT_PX, abs=4)


def test_a_run_that_was_interrupted_goes_on_and_keeps_what_it_had(recording, tmp_path, monkeypatch, capsys):
    real, calls = matcher_module.PairMatcher.image, []

    def second_fails(self, left, right):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(self, left, right)

    monkeypatch.setattr(matcher_module.PairMatcher, "image", second_fails)
    assert depth(recording, tmp_path / "out") != 0
    kept = tmp_path / "out/000000.png"
    first = kept.read_bytes()
    assert values(kept) == pytest.approx(1e3 * _DEPTH_M, abs=6)
    capsys.readouterr()
    assert depth(recording, tmp_path / "out") == 0
    assert "2 pairs matched, 1 were there already" in capsys.readouterr().out
    assert kept.read_bytes() == first and len(list((tmp_path / "out").glob("*.png"))) == 3
    other = settings(tmp_path / "s.json", param_secondpeakdelta=600)
    assert depth(recording, tmp_path / "out", "--settings", other) == 2
    assert "holds depth of another run (settings, matcher differ)" in capsys.readouterr().err


def test_a_damaged_image_ends_the_run_in_one_line_and_the_pairs_before_stay(recording, tmp_path, capsys):
    damaged = recording / "left/2.png"
    damaged.write_bytes(damaged.read_bytes()[:400])
    assert depth(recording, tmp_path / "out") == 2
    assert "damaged" in (err := capsys.readouterr().err) and err.strip().splitlines()[-1].startswith("activestereo: ")
    assert sorted(path.name for path in (tmp_path / "out").glob("*.png")) == ["000000.png", "000001.png"]
    assert values(tmp_path / "out/000001.png") > 0


@pytest.mark.parametrize(
    "arguments, told",
    [
        (["--out", "{recording}/depth"], "lies in the recording"),
        (["--out", "o", "--truth", "x", "--search", "fill", "a.json"], "--search truth needs --truth"),
        (["--search", "speed", "a.json"], "expected one of fill, noise, truth"),
        ([], "-o/--out"),
    ],
)
def test_what_cannot_be_is_told(recording, arguments, told, capsys):
    given = [argument.format(recording=recording) for argument in arguments]
    assert main(["depth", str(recording), *_GEOMETRY, *given]) == 2
    assert told in capsys.readouterr().err


def test_a_search_writes_settings_that_reach_its_goal(recording, tmp_path, capsys):
    truth = tmp_path / "truth"
    truth.mkdir()
    for number in range(3):
        Image.fromarray(np.full((96, 128), round(1e3 * _DEPTH_M), np.uint16)).save(truth / f"{number}.png")
    file = tmp_path / "found.json"
    search = ["depth", str(recording), *_GEOMETRY, "--max-disparity", "16", "--json", "--search"]
    strict = ["--settings", settings(tmp_path / "strict.json", param_secondpeakdelta="1000")]
    assert main([*search, "truth", str(file), "--truth", str(truth), *strict]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["after"]["wrong"] < found["before"]["wrong"]
    assert found["changed"] and json.loads(file.read_text()).keys() >= found["changed"].keys()
