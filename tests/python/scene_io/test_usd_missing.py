# SPDX-License-Identifier: Apache-2.0
"""Where the package usd-core is not installed, one line says so."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from activestereo import cli


def test_the_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "a.usda").write_text("#usda 1.0\n")
    monkeypatch.setitem(sys.modules, "pxr", None)
    code = cli.main(["simulate", str(tmp_path / "a.usda"), "--out", str(tmp_path / "out"), "--device", "cpu"])
    assert code != 0
    assert "pip install usd-core" in capsys.readouterr().err
