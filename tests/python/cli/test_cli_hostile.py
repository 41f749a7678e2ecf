# SPDX-License-Identifier: Apache-2.0
"""Inputs that once ended in a traceback, a hang or endless memory: each ends in one line."""

import argparse
import os
import struct
import subprocess
from functools import partial

import pytest
from command_line import run_here


@pytest.fixture
def run(capsys):
    return partial(run_here, capsys)


def one_line(result: subprocess.CompletedProcess, status: int = 2) -> str:
    assert result.returncode == status, result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1 and "Traceback" not in result.stderr, result.stderr
    return lines[0]


def npy_header(shape: str) -> bytes:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


@pytest.mark.parametrize(
    "shape", ["(99999999, 99999999)", "(4, 5)", "(-1, 5)", "(99999999999999999999, 2)", "()", "(3,)"]
)
def test_an_array_file_that_promises_more_than_it_holds(run, tmp_path, shape):
    (tmp_path / "stack.npy").write_bytes(npy_header(shape) + b"\0" * 8)
    assert "stack.npy" in one_line(run("calibrate", "noise", tmp_path / "stack.npy", "-o", tmp_path / "model.json"))


PARAMETERS = '{"ranking": [{"effect": "read_noise", "parameters": 4}]}'


@pytest.mark.parametrize("text", ['{"ranking": 1}', '{"model": 3}', '{"ranking": [3]}', PARAMETERS, "[]", "{", "7"])
def test_parameters_from_a_file_that_is_no_diagnosis(run, tmp_path, text):
    (tmp_path / "other.json").write_text(text)
    one_line(run("add", "read_noise", "--from", tmp_path / "other.json", "-o", tmp_path / "model.json"))
    assert not (tmp_path / "model.json").exists()


def test_help_into_a_closed_pipe(build):
    command = f"'{build}/bin/activestereo' --help | true"
    result = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, timeout=60)
    assert "Traceback" not in result.stderr and "Exception ignored" not in result.stderr


@pytest.mark.parametrize(
    "raised, said",
    [
        (IndexError("list index\nout of range"), "a fault of the program (IndexError in "),
        (MemoryError(), "out of memory"),
        (ModuleNotFoundError("no cv2", name="cv2"), "pip install 'activestereo[lab]'"),
        (ModuleNotFoundError("no kuafu._kuafu", name="kuafu._kuafu"), "bash examples/quickstart.sh"),
    ],
)
def test_what_nobody_foresaw_and_a_missing_package_are_one_line(monkeypatch, capsys, raised, said):
    from activestereo import cli

    def broken(_: object) -> None:
        raise raised

    monkeypatch.setattr(cli, "_parsed", lambda _: argparse.Namespace(run=broken, allow_outside=False))
    assert cli.main(["presets"]) == 3
    text = capsys.readouterr().err
    assert text.count("\n") == 1 and said in text


@pytest.mark.parametrize("arguments", [["effect", "check", "a\nb"], ["doctor", "a\nb"], ["a\nb"]])
def test_a_name_of_two_lines_is_told_in_one(run, arguments):
    assert r"a\nb" in one_line(run(*arguments))


def test_a_name_that_is_no_utf8_is_told(build, tmp_path):
    command = [build / "bin" / "activestereo", "compare", tmp_path / "\udcff", "-o", tmp_path / "out"]
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    result = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    assert r"\udcff" in one_line(result)
