# SPDX-License-Identifier: Apache-2.0
"""Pages: words, figures, results, docstrings, names of tests."""

import pathlib
import re
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
# References that a script writes from tables or descriptors; their length is not a writer's choice.
GENERATED = {"capi/generation/reference.md", "examples/effects/README.md"}
GENERATED |= {"python/activestereo/camera/advanced_mode/README.md"}
RESULTS = ("tests/bench", "tests/benchmark_suite")
MOST_WORDS, MOST_WORDS_OF_RESULTS, MOST_LINES_OF_A_RELEASE = 39_500, 1_200, 60
MOST_WORDS_EXPLAINED = 25


def words(page: str) -> int:
    return len((ROOT / page).read_text(encoding="utf-8").split())


def tracked(*patterns: str) -> list[str]:
    """Files of these patterns that git tracks and that are there."""
    run = subprocess.run(["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in run.stdout.splitlines() if (ROOT / name).is_file()]


@pytest.mark.parametrize("folder", (*RESULTS, "examples/real_camera"))
def test_a_page_of_results_is_what_its_data_say(folder: str) -> None:
    run = subprocess.run([sys.executable, ROOT / folder / "make_page.py", "--check"], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def test_pages_of_results_stay_short() -> None:
    assert all(words(f"{folder}/README.md") <= MOST_WORDS_OF_RESULTS for folder in RESULTS)


def test_hand_written_prose_stays_short() -> None:
    pages = set(tracked("*.md"))
    assert pages >= GENERATED
    assert sum(words(page) for page in pages - GENERATED) <= MOST_WORDS


def test_there_is_one_glossary_and_it_is_short() -> None:
    glossary = (ROOT / "examples/guide/glossary.md").read_text(encoding="utf-8")
    entries = re.findall(r"^\| ([^|]+) \|", glossary, flags=re.MULTILINE)[1:]
    assert 10 <= len(entries) <= MOST_WORDS_EXPLAINED
    assert entries == sorted(entries, key=str.lower)
    pages = [ROOT / page for page in tracked("*.md")]
    others = [page for page in pages if re.search(r"^\| *(term|word) *\|", page.read_text("utf-8"), re.MULTILINE)]
    assert others == [ROOT / "examples/guide/glossary.md"]


def test_a_release_of_the_changelog_fits_a_screen() -> None:
    releases = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    names = [release.split("]")[0] for release in releases]
    assert [name for name in names if name != "[Unreleased"][:2] == ["[0.2.0", "[0.1.0"]
    assert [r.splitlines()[0] for r in releases if len(r.splitlines()) > MOST_LINES_OF_A_RELEASE] == []


def test_a_script_makes_every_picture_on_a_page() -> None:
    """By its name, without a number; in the gallery, by its tile's. first_screen.jpg is a browser's, of a report."""
    scripts, pages = ("\n".join((ROOT / name).read_text() for name in names) for names in
                      (tracked("*.py", "*.sh"), tracked("*.md")))  # fmt: skip
    pictures = {pathlib.Path(name).stem for name in re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", pages)} - {"first_screen"}
    named = set(re.findall(r"\w+", scripts))
    assert len(pictures) > 100
    assert not [name for name in sorted(pictures) if not set(re.sub(r"-\d+$", "", name).split("-")) <= named]


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
    page = (GUIDE / "figures.md").read_text("utf-8")
    rows = re.findall(r"^\|(.+)\|(.+)\|`(.+)`\|\[\w[\w-]*\]\((.+)\)\|$", page, re.M)
    assert len(rows) > 10
    assert not [file for *_, file in rows if not (GUIDE / file).is_file()]


def test_figures_are_told_from_other_numbers() -> None:
    text = "640x480 in 8.3 ms, at most 2 GB; 90 % intervals; `--limit 5 s`; 5 of 24; 1.5 %; RTX-4090 s"
    assert figures_of(text) == ["8.3 ms", "5 of 24", "1.5 %"]


FOLDERS = ("capi", "kuafu", "simsense", "python", "examples", "tests", "third_party_notes")
NO_SUBJECT = re.compile(r'^ *[rR]?"""((?:Of|What) .*)', re.MULTILINE)


def test_docstrings_begin_with_their_subject() -> None:
    sample = '"""Of the fit: its error."""\ndef f():\n    """What it is."""\nclass Offset:\n    """Offset."""'
    assert len(NO_SUBJECT.findall(sample)) == 2
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    assert len(paths) > 300
    found = {path.relative_to(ROOT): NO_SUBJECT.findall(path.read_text(encoding="utf-8")) for path in paths}
    assert not {str(path): lines for path, lines in found.items() if lines}


TESTS = pathlib.Path(__file__).resolve().parents[1]
PAGE = (TESTS / "README.md").read_text(encoding="utf-8")


def named() -> set[str]:
    """`Suite.Name`, `...Name` (of the suite before), `Suite.*` and `folder/test_file.py` in tables' last cells."""
    cells = [line.split("|")[-2] for line in PAGE.splitlines() if line.startswith("| ") and line.count("|") > 2]
    return {name for cell in cells for name in re.findall(r"`([^`]+)`", cell)}


def test_each_named_gtest_exists() -> None:
    found = set()
    for path in TESTS.rglob("*_test.cpp"):
        for suite, name in re.findall(r"^(?:TYPED_)?TEST(?:_[FP])?\((\w+),\s*(\w+)\)", path.read_text("utf-8"), re.M):
            found |= {f"{suite}.{name}", f"{suite}.*", f"...{name}"}
    tests = {name for name in named() if not name.endswith((".py", ".sh"))}
    wanted = {name for name in tests if re.fullmatch(r"(\w+|\.\.)\.(\w+|\*)", name)}
    assert len(wanted) > 20
    assert not wanted - found


def test_each_named_python_file_exists() -> None:
    wanted = {name for name in named() if re.fullmatch(r"\w+/test_\w+\.py", name)}
    assert len(wanted) >= 4
    assert {name for name in wanted if not (TESTS / "python" / name).exists() and not (TESTS / name).exists()} == set()


def test_pythons_tests_stand_by_package() -> None:
    modules = TESTS.parent / "python"
    packages = {path.parent.name for path in (modules / "activestereo").glob("*/__init__.py")}
    subjects = packages | {"kuafu", "simsense", "bindings", "benchmark_suite"}
    folders = {path.parent for path in (TESTS / "python").rglob("test_*.py")}
    assert {folder.name for folder in folders} <= subjects
    assert {folder.parent for folder in folders} == {TESTS / "python"}
