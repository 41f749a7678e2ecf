# SPDX-License-Identifier: Apache-2.0
"""Words of the command line: options, help, screens."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from activestereo.capture.images import write_gray
from activestereo.cli import main
from activestereo.cli.arguments import EXIT_CODES, Parser
from activestereo.cli.simulate import depth_sentence, failing
from activestereo.common.accuracy import NOTHING, Accuracy
from activestereo.common.own_files import outside_allowed
from activestereo.report.screen import Figure, command, screen
from command_line import leaves, led_on, refused, run_here

PAGE = Path(__file__).resolve().parents[3] / "examples/guide/command_line.md"


def test_results_go_where_out_or_o_says_in_every_command():
    assert len(leaves()) > 20
    for name, parser in leaves().items():
        options = parser._option_string_actions
        assert options.get("-o") is options.get("--out"), name
        assert not {"--output", "--write"} & set(options), name


@pytest.mark.parametrize(
    "arguments, meant",
    [
        (["diagnos", "x"], "did you mean 'diagnose'?"),
        (["SIMULATE", "x"], "did you mean 'simulate'?"),
        (["model", "shw", "x"], "did you mean 'show'?"),
        (["simulate", "x.gltf", "--sensr", "d435"], "unknown option --sensr; did you mean '--sensor'?"),
        (["simulate", "x.gltf", "--lazer-power=3", "--out", "x"], "did you mean '--laser-power'?"),
        (["--allow-outsde", "compare", "x"], "did you mean '--allow-outside'?"),
        (["depth", "l", "r", "--profile", "activ"], "did you mean 'active'?"),
        (["simulate", "--scene", "x.gltf"], "unknown option --scene; SCENE is given as a word alone"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_nearest(arguments, meant, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    said = capsys.readouterr().err
    assert ended.value.code == 2 and said.count("\n") == 1 and meant in said, said


def test_every_help_fits_a_terminal(monkeypatch):
    """Prose is filled anew, and a command goes on in a line that a shell takes for the same one."""
    monkeypatch.setenv("COLUMNS", "80")
    for name, parser in leaves().items():
        for text in (parser.format_help(), parser.format_help(with_rare=True)):
            assert max(map(len, text.splitlines())) <= 80, name
    own = Parser(description=f"{'word ' * 20}\n\nexamples:\n  activestereo depth {'file ' * 20}-o out\n  last")
    prose, command = own.format_help().split("\n\n")[1:3]
    assert len(prose.splitlines()) == 2 and " \\\n      file" in command and command.endswith("-o out\n  last")


def test_no_command_is_answered_with_what_one_may_want(capsys):
    """The screen has the rows of the first page's table that are commands, and no other."""
    assert main([]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) <= 24 and max(map(len, said.splitlines())) <= 80
    table = (PAGE.parents[2] / "README.md").read_text(encoding="utf-8").partition("## What you want")[2]
    named = re.compile(r"\bactivestereo ([a-z]+)")
    assert set(named.findall(said.partition("\n\n")[2].rpartition("\n\n")[0])) == set(named.findall(table))


def test_a_misspelt_effect_or_ending_is_answered_with_the_right_one(capsys, tmp_path):
    told = refused(("add", "vigneting", "-o", tmp_path / "model.json"), capsys)
    assert told.endswith("; did you mean 'vignetting'?")
    misspelt = '"effects": [{"id": "lens_psff", "parameters": {}}]'
    (tmp_path / "model.json").write_text(f'{{"format": "active-stereo-model", "version": 1, {misspelt}}}')
    assert refused(("model", "show", tmp_path / "model.json"), capsys).endswith("; did you mean 'lens_psf'?")
    told = refused(("effect", "show", "vignetting", "-o", tmp_path / "strip"), capsys)
    assert "ends in .png, a page's in .html" in told


def test_the_page_has_every_exit_status_and_no_other():
    told = {int(number) for number in re.findall(r"^\| (\d+) \|", PAGE.read_text(encoding="utf-8"), re.M)}
    assert told == set(EXIT_CODES)


def test_no_help_has_a_broken_default_and_rare_options_are_found():
    for name, parser in leaves().items():
        every = " ".join(parser.format_help(with_rare=True).split())
        assert not re.search(r"\b(python|examples|tests|capi|kuafu|simsense|activestereo)/", every), name
        assert not re.search(r"sx[a-z]|%\(|default: None|<class|default: \)|'[sx]x", every), name
        assert all(option in every for option in parser._option_string_actions if option.startswith("--")), name
        short = parser.format_help()
        assert " ".join(short.split()) == every or "more (--help-all): " in short, name
        assert len(short.splitlines()) < 130, name


LINES = {
    "dia": "diagnose", "calibrate no": "noise", "simulate x.gltf --laser": "--laser-power",
    "depth --profile pass": "passive", "depth l.png --profile passive --basel": "--baseline",
    "--allow-outside mod": "model",
}  # fmt: skip


@pytest.mark.parametrize("line, answer", LINES.items())
def test_names_are_completed(monkeypatch, line, answer):
    pytest.importorskip("argcomplete", reason="argcomplete is not installed (apt-get install python3-argcomplete)")
    line = f"activestereo {line}"
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "|", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    for name, value in asked.items():
        monkeypatch.setenv(name, value)
    words = ["bash", "-c", f"{sys.executable} -m activestereo 8>&1 9>/dev/null"]
    told = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True).stdout
    assert [word.strip() for word in told.split("|")] == [answer]


_RIG = ("--k", "80,80,79.5,44.5", "--baseline", "0.05")


@pytest.fixture(scope="module")
def files(tmp_path_factory, depth_capture):
    """A pair of random dots 8 px apart in left.png and right.png, a capture, and a place for results."""
    folder, rng = tmp_path_factory.mktemp("screens"), np.random.default_rng(0)
    dots = np.where(rng.random((90, 168)) < 0.1, 200, 30).astype(np.uint8) + rng.integers(0, 9, (90, 168), np.uint8)
    write_gray(folder / "left.png", dots[:, :160])
    write_gray(folder / "right.png", dots[:, 8:])
    shutil.copytree(depth_capture, folder / "table")
    return folder


def test_a_material_without_any_depth_leads_and_the_background_is_none():
    mirror, paper = Accuracy("mirror", 900, 0.0, np.nan, np.nan, 0.0), Accuracy("paper", 5000, 0.99, 1e-3, 2e-3, 0.0)
    background, whole = Accuracy(NOTHING, 9000, 0.0, np.nan, np.nan, 0.0), Accuracy("all", 5900, 0.8, 1e-3, 2e-3, 0.0)
    told = failing([paper, mirror, background, whole])
    assert [figure.name for figure in told] == ["mirror", "paper"]
    assert depth_sentence("a D435", [whole]).endswith("0 % are invented: of nothing, or off by more than 5 %.")
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
        text = screen("Sentence.", steps=[command("compare", odd, "-o", "x" * 70)])
    assert text.count("\n") == 2  # broken before options, and by nothing else
    assert led_on(text) == [["--allow-outside", "compare", odd, "-o", "x" * 70]]


@pytest.mark.parametrize(
    "words",
    [
        ("add", "projector_defocus", "-o", "model.json"), ("model", "show", "model.json"),
        ("depth", "left.png", "right.png", *_RIG, "-o", "depth"),
        ("depth", "left.png", "right.png", *_RIG, "-o", "depth", "--verbose"), ("depth", "table", "-o", "again"),
        ("pair", "left.png", "right.png", *_RIG, "-o", "pair"),
        ("effect", "list"), ("effect", "check", "vignetting"), ("presets",), ("doctor",),
    ],
    ids=" ".join,
)  # fmt: skip
def test_every_screen_fits_a_terminal(words, files, monkeypatch, capsys):
    """Only a path, which a shell must take whole, is wider."""
    monkeypatch.chdir(files)
    monkeypatch.setattr("activestereo.compare.effect_trials._SAMPLES", 2)
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
