# SPDX-License-Identifier: Apache-2.0
"""activestereo demo: the steps run as they would alone, the hidden effect is in the images, and it is told last. What
simulate and diagnose find is their own tests'."""

import json
from functools import partial

import numpy as np
import pytest

from activestereo.benchmarks import example_capture
from activestereo.capture.capture import read_capture
from activestereo.cli import demo, diagnose, main, simulate


@pytest.fixture
def steps(monkeypatch):
    """The options of simulate and diagnose, which do nothing but say so."""
    seen = []
    for command in (simulate, diagnose):
        monkeypatch.setattr(command, "run", lambda args: (seen.append(args), print(f"ran {args.command}")))
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
    assert answer["effect"] in said and str(tmp_path / "d/report/report.html") in said
    assert opened == ([(tmp_path / "d/report/report.html").as_uri()] if display else [])


def test_a_folder_that_is_there_is_left_alone(tmp_path, capsys, steps):
    (tmp_path / "capture").mkdir()
    assert main(["demo", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"activestereo: {tmp_path}/capture exists already: give another --out\n"
    assert not steps
