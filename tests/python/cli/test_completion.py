# SPDX-License-Identifier: Apache-2.0
"""A shell completes commands, options and choices through argcomplete."""

import subprocess
import sys

import pytest

pytest.importorskip("argcomplete", reason="argcomplete is not installed (apt-get install python3-argcomplete)")


LINES = {
    "dia": "diagnose", "calibrate no": "noise", "simulate x.gltf --laser": "--laser-power",
    "depth --profile pass": "passive", "depth l.png --profile passive --basel": "--baseline",
    "--allow-outside mod": "model",
}  # fmt: skip


@pytest.mark.parametrize("line, answer", LINES.items())
def test_names_are_completed(monkeypatch, line, answer):
    line = f"activestereo {line}"
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "|", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    for name, value in asked.items():
        monkeypatch.setenv(name, value)
    words = ["bash", "-c", f"{sys.executable} -m activestereo 8>&1 9>/dev/null"]
    told = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True).stdout
    assert [word.strip() for word in told.split("|")] == [answer]
