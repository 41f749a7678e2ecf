# SPDX-License-Identifier: Apache-2.0
"""activestereo demo runs its steps as they would alone; the hidden effect is in the images and is told last."""

import json
from functools import partial

import numpy as np
import pytest

from activestereo.benchmarks import example_capture
from activestereo.benchmarks.example_capture import HIDDEN
from activestereo.capture.capture import SIDES, read_capture
from activestereo.cli import demo, diagnose, main, simulate
from activestereo.effects import builtin


@pytest.fixture
def steps(monkeypatch):
    """The options of simulate and diagnose, which do nothing but say so."""
    seen = []
    nothing = {"verdict": "none", "added": [], "ranking": []}
    for command in (simulate, diagnose):

        def ran(args):
            seen.append(args)
            args.out.mkdir()
            (args.out / "diagnose.json").write_text(json.dumps(nothing))
            print(f"ran {args.command}")

        monkeypatch.setattr(command, "run", ran)
    quick = partial(example_capture.write_example_capture, samples_per_pixel=1)
    monkeypatch.setattr(example_capture, "write_example_capture", quick)
    return seen


@pytest.mark.parametrize("display", ["", ":0"])
def test_an_effect_is_hidden_and_told_last(tmp_path, capsys, steps, monkeypatch, display):
    opened = []
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(demo.webbrowser, "open_new_tab", opened.append)
    assert main(["demo", "--out", str(tmp_path / "d"), "--seed", "3", "--device", "cpu"]) == 0
    said = capsys.readouterr().out
    assert [args.command for args in steps] == ["simulate", "diagnose"]
    hidden = read_capture(steps[1].capture)
    plain = example_capture.write_example_capture(tmp_path / "plain", "cpu", 3)
    pairs = list(zip(plain.frames, hidden.frames, strict=True))
    changed = [np.mean((plain.ir(a, side) - hidden.ir(b, side)) ** 2) for a, b in pairs for side in SIDES]
    assert np.sqrt(min(changed)) > 1.0
    assert {frame.split for frame in hidden.frames} == {"train", "test"} and len(hidden.repeats()) == 1
    secret = said.split("hidden: ")[1].split(",")[0]
    assert secret in HIDDEN and secret not in said[: said.index("ran diagnose")]
    assert "found: no, the verdict is none" in said
    assert str(tmp_path / "d/report/report.html") in said
    assert opened == ([(tmp_path / "d/report/report.html").as_uri()] if display else [])


def test_what_was_hidden_and_found_have_one_name_and_one_unit():
    row = {"value": 0.17, "low": 0.15, "high": 0.21, "unit": "1"}
    found = {"added": ["gain_mismatch"], "ranking": [{"effect": "gain_mismatch", "parameters": {"gain": row}}]}
    said = "found: {}, gain_mismatch, gain 0.17 (0.15 to 0.21)"
    assert demo._outcome("gain_mismatch", found) == "hidden: gain_mismatch, gain 0.18\n" + said.format("yes")
    assert demo._outcome("vignetting", found) == "hidden: vignetting, exponent 3\n" + said.format("no")


def test_what_is_hidden_follows_its_law_under_the_labs_names(tmp_path):
    assert all(parameter in [p.name for p in builtin()[name].parameters] for name, (parameter, _) in HIDDEN.items())
    K, (v, u) = np.array([[80.0, 0, 47.5], [0, 80.0, 35.5], [0, 0, 1]]), np.indices((72, 96), dtype=float)
    x, y = (76.0 - 47.5) / 80.0, (16.0 - 35.5) / 80.0
    even = example_capture._through_lens(np.full((72, 96), 100.0), K, "vignetting")
    assert even[16, 76] == pytest.approx(100.0 * np.cos(np.arctan(np.hypot(x, y))) ** HIDDEN["vignetting"][1])
    spot = np.exp(-((u - 76.0) ** 2 + (v - 16.0) ** 2) / 3.0)
    bent = example_capture._through_lens(spot, K, "radial_distortion")
    moved = np.array([((u - 76.0) * bent).sum(), ((v - 16.0) * bent).sum()]) / bent.sum()
    r2 = x * x + y * y
    assert moved == pytest.approx(80.0 * HIDDEN["radial_distortion"][1] * r2 * np.array([x, y]), abs=5e-3)
    write, names = example_capture.write_example_capture, (None, "gain_mismatch")
    plain, hidden = (write(tmp_path / str(name), "cpu", samples_per_pixel=1, hidden=name) for name in names)
    gain = [hidden.ir(hidden.frames[0], side).sum() / plain.ir(plain.frames[0], side).sum() for side in SIDES]
    half = 0.5 * HIDDEN["gain_mismatch"][1]
    assert gain == pytest.approx([1.0 - half, 1.0 + half], abs=0.02)


def test_a_folder_that_is_there_is_left_alone(tmp_path, capsys, steps):
    (tmp_path / "capture").mkdir()
    assert main(["demo", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"activestereo: {tmp_path}/capture exists already: give another --out\n"
    assert not steps
