# SPDX-License-Identifier: Apache-2.0
"""activestereo demo: the steps run as they would alone, the hidden effect is in the images, and it is told last. What
simulate and diagnose find is their own tests'."""

import json
from functools import partial

import numpy as np
import pytest

from activestereo.benchmarks import example_capture
from activestereo.benchmarks.inject.kinds import KINDS
from activestereo.capture.capture import read_capture
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
    plain, hidden = read_capture(tmp_path / "d/without_effect"), read_capture(steps[1].capture)
    answer = json.loads((tmp_path / "d/capture/answer.json").read_text())
    pairs = list(zip(plain.frames, hidden.frames, strict=True))
    changed = [np.mean((plain.ir(a, side) - hidden.ir(b, side)) ** 2) for a, b in pairs for side in answer["cameras"]]
    assert np.sqrt(min(changed)) > 1.0
    assert {frame.split for frame in hidden.frames} == {"train", "test"} and len(hidden.repeats()) == 1
    assert answer["effect"] in demo._HIDDEN and answer["effect"] not in said[: said.index("ran diagnose")]
    assert f"hidden: {demo._HIDDEN[answer['effect']][0]}, " in said and "found: no, the verdict is none" in said
    assert str(tmp_path / "d/report/report.html") in said
    assert opened == ([(tmp_path / "d/report/report.html").as_uri()] if display else [])


@pytest.mark.parametrize("side, sign", [("left", -1), ("right", 1)])
def test_what_was_hidden_and_found_have_one_name_and_one_unit(side, sign):
    """The lab splits a difference of gains between the cameras."""
    answer = {"effect": "gain", "parameters": {"excess": 0.2}, "cameras": [side]}
    (name, parameter, _), row = demo._HIDDEN["gain"], {"value": 0.18, "low": 0.15, "high": 0.21, "unit": "1"}
    found = {"effect": name, "parameters": {parameter: row}}
    said = demo._told(answer, {"verdict": "effect", "added": [name], "ranking": [found]})
    value = float(said.split("gain ", 1)[1].split()[0])
    assert (1 + 0.5 * value) / (1 - 0.5 * value) == pytest.approx(1.2**sign, abs=1e-3)
    assert said.splitlines()[1] == "found: yes, gain_mismatch, gain 0.18 (0.15 to 0.21)"
    other = answer | {"effect": "vignetting"}
    assert "found: no, gain_mismatch" in demo._told(other, {"added": [name], "ranking": [found]})


def test_the_lab_has_what_is_hidden_under_its_names():
    for kind, (name, parameter, _) in demo._HIDDEN.items():
        assert name in KINDS[kind].accepted and parameter in [p.name for p in builtin()[name].parameters]


def test_a_folder_that_is_there_is_left_alone(tmp_path, capsys, steps):
    (tmp_path / "capture").mkdir()
    assert main(["demo", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"activestereo: {tmp_path}/capture exists already: give another --out\n"
    assert not steps
