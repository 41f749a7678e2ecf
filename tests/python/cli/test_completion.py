# SPDX-License-Identifier: Apache-2.0
"""The shells complete commands, options and choices by the script of the command completion."""

import shutil
import subprocess

import pytest

from activestereo.cli import main


def completed(script, words, shell="bash"):
    """The answers to the last of the words."""
    line = " ".join(f"'{word}'" for word in words)
    ask = f"COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _activestereo; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    result = subprocess.run([shell, "-c", f"{script}\n{ask}"], capture_output=True, text=True, timeout=60, check=True)
    return result.stdout.split()


@pytest.mark.parametrize(
    "words, answers",
    [
        (["activestereo", "dia"], ["diagnose"]),
        (["activestereo", "calibrate", "no"], ["noise"]),
        (["activestereo", "benchmark", "sim-to-real", "ab"], ["ablate"]),
        (["activestereo", "simulate", "x.gltf", "--laser"], ["--laser-power"]),
        (["activestereo", "depth", "--profile", "pass"], ["passive"]),
        (["activestereo", "depth", "l.png", "--profile", "passive", "--basel"], ["--baseline"]),
        (["activestereo", "--allow-outside", "mod"], ["model"]),
        (["activestereo", "model", "show", "no-such-file"], []),
    ],
)
def test_bash_completes_names(capsys, words, answers):
    assert main(["completion", "bash"]) == 0
    assert completed(capsys.readouterr().out, words) == answers


def test_bash_completes_files_elsewhere(capsys, tmp_path):
    (tmp_path / "scene.gltf").touch()
    main(["completion", "bash"])
    assert completed(capsys.readouterr().out, ["activestereo", "simulate", f"{tmp_path}/sc"]) == [
        f"{tmp_path}/scene.gltf"
    ]


def test_zsh_reads_its_script(capsys):
    main(["completion", "zsh"])
    script = capsys.readouterr().out
    assert script.startswith("#compdef activestereo\n") and "bashcompinit" in script
    if shutil.which("zsh") is None:
        pytest.skip("zsh is not installed")
    subprocess.run(["zsh", "-fc", f"autoload -U compinit && compinit -u -D\n{script}"], timeout=60, check=True)
