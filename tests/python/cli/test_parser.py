# SPDX-License-Identifier: Apache-2.0
"""The parser of all commands: the same name of one thing everywhere, the nearest known name of an unknown one, and
completion in a shell."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from activestereo.cli import main, make_parser
from activestereo.cli.arguments import EXIT_CODES, Parser
from activestereo.diagnose.numbers import NUMBERS
from command_line import leaves


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


def test_a_misspelt_effect_is_answered_with_the_nearest(capsys, tmp_path):
    assert main(["add", "vigneting", "-o", str(tmp_path / "model.json")]) == 2
    assert capsys.readouterr().err.endswith("; did you mean 'vignetting'?\n")
    misspelt = '"effects": [{"id": "lens_psff", "parameters": {}}]'
    (tmp_path / "model.json").write_text(f'{{"format": "active-stereo-model", "version": 1, {misspelt}}}')
    assert main(["model", "show", str(tmp_path / "model.json")]) == 2
    assert capsys.readouterr().err.endswith("; did you mean 'lens_psf'?\n")


def test_an_option_may_be_cut_short_and_values_after_two_dashes_are_no_options():
    assert make_parser().parse_args(["compare", "x", "--ou", "y"]).out == Path("y")
    assert make_parser().parse_args(["model", "show", "--", "--odd.json"]).files == [Path("--odd.json")]


def test_the_page_has_every_exit_status_and_no_other():
    told = {int(number) for number in re.findall(r"^\| (\d+) \|", PAGE.read_text(encoding="utf-8"), re.M)}
    assert told == set(EXIT_CODES)


def test_no_help_has_a_broken_default_and_rare_options_are_found():
    for name, parser in leaves().items():
        every = " ".join(parser.format_help(with_rare=True).split())
        assert not re.search(r"sx[a-z]|%\(|default: None|<class|default: \)|'[sx]x", every), name
        assert all(option in every for option in parser._option_string_actions if option.startswith("--")), name
        short = parser.format_help()
        assert " ".join(short.split()) == every or "more (--help-all): " in short, name
        assert len(short.splitlines()) < 130, name
    told = leaves()["diagnose"].format_help()
    assert f"(--alpha {NUMBERS.alpha:g})" in told and f"removes {NUMBERS.least_share:g} of the squared error" in told


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
