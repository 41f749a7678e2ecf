# SPDX-License-Identifier: Apache-2.0
"""The first page fits one screen, its Python example runs, and the guide's links lead somewhere."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from activestereo.cli import make_parser

ROOT = Path(__file__).resolve().parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")
GUIDE = ROOT / "examples/guide"
# Doxygen writes this one when the site is built.
MADE_LATER = ROOT / "capi/include/html"


def test_first_page_fits_one_screen():
    lines = README.splitlines()
    assert len(lines) <= 70
    assert max(map(len, lines)) <= 180


def test_example_runs_and_measures_most_of_the_table(tmp_path, build):
    (code,) = re.findall(r"```python\n(.*?)```", README, re.S)
    assert len(code.strip().splitlines()) <= 24
    where = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(build / "python")}}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, **where)
    assert run.returncode == 0, run.stderr
    said = r"([\d.]+) % measured, median error ([\d.]+) mm, (\d+) points\n"
    measured, error_mm, points = map(float, re.fullmatch(said, run.stdout).groups())
    assert measured > 85.0 and error_mm < 15.0 and points > 50_000


@pytest.mark.parametrize("page", [ROOT / "README.md", *sorted(GUIDE.glob("*.md"))], ids=lambda page: page.name)
def test_links_lead_to_files(page):
    for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        target = (page.parent / link).resolve()
        assert target.exists() or target.is_relative_to(MADE_LATER), link


def test_first_page_leads_to_the_pages_of_the_guide():
    """Each page of prose is reached from the first one; references and the site's own page are not."""
    for page in {path.name for path in GUIDE.glob("*.md")} - {"README.md", "c_api.md", "python_api.md"}:
        assert f"(examples/guide/{page})" in README, page


def test_page_of_the_command_line_has_every_command():
    page = (GUIDE / "command_line.md").read_text(encoding="utf-8")
    (commands,) = [action.choices for action in make_parser()._actions if action.dest == "command"]
    assert len(commands) > 10
    for command in commands:
        assert re.search(rf"`activestereo {command}[ `]", page), command
