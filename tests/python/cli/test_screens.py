# SPDX-License-Identifier: Apache-2.0
"""The end of a command fits ten lines of 80 columns, its commands keep the words that were meant, and no screen of any
command is wider."""

import numpy as np
import pytest

from activestereo.capture.images import write_gray
from activestereo.cli.simulate import failing
from activestereo.common.accuracy import NOTHING, Accuracy
from activestereo.common.own_files import outside_allowed
from activestereo.report.screen import Figure, command, screen
from command_line import led_on, refused, run_here
from lab_worlds import with_device_depth
from virtual_sensor.world import make_world

_RIG = ("--k", "80,80,79.5,44.5", "--baseline", "0.05")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A pair of random dots 8 px apart in left.png and right.png, a capture, and a place for results."""
    folder, rng = tmp_path_factory.mktemp("screens"), np.random.default_rng(0)
    dots = np.where(rng.random((90, 168)) < 0.1, 200, 30).astype(np.uint8) + rng.integers(0, 9, (90, 168), np.uint8)
    write_gray(folder / "left.png", dots[:, :160])
    write_gray(folder / "right.png", dots[:, 8:])
    with_device_depth(make_world(folder / "world", size=(160, 90), grid=1), folder / "table", ids=(0, 2))
    return folder


def test_a_material_without_any_depth_leads_and_the_background_is_none():
    mirror, paper = Accuracy("mirror", 900, 0.0, np.nan, np.nan, 0.0), Accuracy("paper", 5000, 0.99, 1e-3, 2e-3, 0.0)
    background, whole = Accuracy(NOTHING, 9000, 0.0, np.nan, np.nan, 0.0), Accuracy("all", 5900, 0.8, 1e-3, 2e-3, 0.0)
    told = failing([paper, mirror, background, whole])
    assert [figure.name for figure in told] == ["mirror", "paper"]
    assert told[0].said == "100 % empty, 0 % invented" and told[1].said.endswith("1.0 mm")


def test_a_screen_keeps_its_lines_and_its_words():
    notes = ["most important", "a long note " * 14, "told under --verbose alone " * 9]
    figures = [Figure("first", "2.00 DN", 2.0), Figure("second", "1.00 DN", 1.0), Figure("third", "none")]
    text = screen("Sentence.", figures, notes, see="report.html")
    first, second = (line.count("█") for line in text.splitlines()[1:3])
    assert first == 2 * second and "third" in text and "most important" in text and "told under" not in text
    assert "see: report.html (more: --verbose)" in text and max(map(len, text.splitlines())) <= 80
    assert "told under" in screen("Sentence.", figures, notes, verbose=True)


def test_a_shell_gets_the_words_that_were_meant():
    odd = 'a folder/it\'s \\ "new"\n'
    with outside_allowed():
        text = screen("Sentence.", steps=[command("compare", odd, "--model", None, "-o", "x" * 70)])
    assert text.count("\n") == 2  # broken before options, and by nothing else
    assert led_on(text) == [["--allow-outside", "compare", odd, "-o", "x" * 70]]


@pytest.mark.parametrize(
    "words",
    [
        ("add", "projector_defocus", "-o", "model.json"), ("model", "show", "model.json"),
        ("model", "diff", "model.json", "model.json"), ("depth", "left.png", "right.png", *_RIG, "-o", "depth"),
        ("depth", "left.png", "right.png", *_RIG, "-o", "depth", "--verbose"), ("depth", "table", "-o", "again"),
        ("pair", "left.png", "right.png", *_RIG, "-o", "pair"),
        ("effect", "list"), ("effect", "check", "vignetting"), ("presets",), ("doctor",),
    ],
    ids=" ".join,
)  # fmt: skip
def test_every_screen_fits_a_terminal(words, files, monkeypatch, capsys):
    """Only a path, which a shell must take whole, is wider."""
    monkeypatch.chdir(files)
    end = run_here(capsys, *words)
    assert end.returncode == 0 and end.stdout, end.stderr
    wide = [line for line in end.stdout.splitlines() if len(line) > 80 and max(map(len, line.split())) < 60]
    assert not wide


def test_a_pair_leads_on_to_its_sensor_and_a_capture_brings_its_cameras(files, monkeypatch, capsys):
    monkeypatch.chdir(files)
    [lead] = led_on(run_here(capsys, "depth", "left.png", "right.png", *_RIG, "-o", "led").stdout)
    assert lead[0] == "pair" and run_here(capsys, *lead).returncode == 0
    end = run_here(capsys, "depth", "table", "-o", "own")
    assert end.returncode == 0 and "assumed" not in end.stdout
    assert "table/capture.json: has K" in refused(("depth", "table", *_RIG, "-o", "other"), capsys)


def test_what_a_command_does_not_know_points_to_its_own_help(capsys):
    said = run_here(capsys, "add", "haze", "model.json", "-o", "m.json").stderr
    assert said.endswith("unrecognized arguments: model.json (see activestereo add --help)\n")


def test_a_strip_is_a_picture_or_a_page(capsys, tmp_path):
    told = refused(("effect", "show", "vignetting", "-o", tmp_path / "strip"), capsys)
    assert "ends in .png, a page's in .html" in told
