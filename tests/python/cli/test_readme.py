# SPDX-License-Identifier: Apache-2.0
"""The README's Python example runs as it stands, and its links lead somewhere."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_example_runs_and_measures_most_of_the_table(tmp_path, build):
    (code,) = re.findall(r"```python\n(.*?)```", README, re.S)
    assert len(code.strip().splitlines()) <= 24
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(build / "python")},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert run.returncode == 0, run.stderr
    measured, error_mm, points = re.fullmatch(
        r"([\d.]+) % measured, median error ([\d.]+) mm, (\d+) points\n", run.stdout
    ).groups()
    assert float(measured) > 85.0
    assert float(error_mm) < 15.0
    assert int(points) > 50_000


def test_links_lead_to_files():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).exists(), target
