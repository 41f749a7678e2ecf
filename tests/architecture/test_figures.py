# SPDX-License-Identifier: Apache-2.0
"""Pages quote measured figures as examples/guide/figures.md has them, which takes each from a file of results."""

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
GUIDE = ROOT / "examples/guide"
PAGES = [ROOT / "README.md", *sorted(page for page in GUIDE.glob("*.md") if page.name != "figures.md")]
UNITS = "%|mm|ms|s|px|MB|GB|fps|times|(?:processor )?seconds?|minutes?|frames|pairs"
FIGURE = re.compile(rf"(?<![\w.-])(\d+(?:\.\d+)? (?:{UNITS})(?!\w)|\d+ of \d+)")
# A confidence level and a limit are no measurements; code is an example.
NO_FIGURE = re.compile(r"```.*?```|`[^`]*`|\b\d+ % intervals|at most [\d.]+ \w+", re.DOTALL)


def figures_of(text: str) -> list[str]:
    return FIGURE.findall(NO_FIGURE.sub("", text))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_quotes_no_figure_without_a_command(page: pathlib.Path) -> None:
    known = set(figures_of((GUIDE / "figures.md").read_text(encoding="utf-8")))
    unknown = [figure for figure in figures_of(page.read_text(encoding="utf-8")) if figure not in known]
    assert not unknown, f"{page.name}: add to FIGURES of tests/bench/figures.py, with a file of results, or leave out"


def test_a_figure_names_its_command_and_an_existing_file_of_results() -> None:
    rows = re.findall(
        r"^\|(.+)\|(.+)\|`(.+)`\|\[\w[\w-]*\]\((.+)\)\|$", (GUIDE / "figures.md").read_text("utf-8"), re.M
    )
    assert len(rows) > 10
    assert not [file for *_, file in rows if not (GUIDE / file).is_file()]


def test_figures_are_told_from_other_numbers() -> None:
    text = "640x480 in 8.3 ms, at most 2 GB; 90 % intervals; `--limit 5 s`; 5 of 24; 1.5 %; RTX-4090 s"
    assert figures_of(text) == ["8.3 ms", "5 of 24", "1.5 %"]
