# SPDX-License-Identifier: Apache-2.0
"""Pages of results are what their data say, and prose stays short."""

import pathlib
import re
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
# References that a script writes from tables or descriptors; their length is not a writer's choice.
GENERATED = {
    "capi/generation/reference.md",
    "examples/effects/README.md",
    "python/activestereo/camera/advanced_mode/README.md",
}
RESULTS = ("tests/bench", "tests/benchmark_suite")
MOST_WORDS, MOST_WORDS_OF_RESULTS, MOST_LINES_OF_A_RELEASE = 39_500, 1_200, 60
MOST_WORDS_EXPLAINED = 25


def words(page: str) -> int:
    return len((ROOT / page).read_text(encoding="utf-8").split())


@pytest.mark.parametrize("folder", (*RESULTS, "examples/real_camera"))
def test_a_page_of_results_is_what_its_data_say(folder: str) -> None:
    run = subprocess.run([sys.executable, ROOT / folder / "make_page.py", "--check"], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def test_pages_of_results_stay_short() -> None:
    assert all(words(f"{folder}/README.md") <= MOST_WORDS_OF_RESULTS for folder in RESULTS)


def test_hand_written_prose_stays_short() -> None:
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    pages = set(listed.stdout.splitlines())
    assert pages >= GENERATED
    assert sum(words(page) for page in pages - GENERATED if (ROOT / page).is_file()) <= MOST_WORDS


def test_there_is_one_glossary_and_it_is_short() -> None:
    glossary = (ROOT / "examples/guide/glossary.md").read_text(encoding="utf-8")
    entries = re.findall(r"^\| ([^|]+) \|", glossary, flags=re.MULTILINE)[1:]
    assert 10 <= len(entries) <= MOST_WORDS_EXPLAINED
    assert entries == sorted(entries, key=str.lower)
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    pages = [ROOT / page for page in listed.stdout.splitlines() if (ROOT / page).is_file()]
    others = [page for page in pages if re.search(r"^\| *(term|word) *\|", page.read_text("utf-8"), re.MULTILINE)]
    assert others == [ROOT / "examples/guide/glossary.md"]


def test_a_release_of_the_changelog_fits_a_screen() -> None:
    releases = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    names = [release.split("]")[0] for release in releases]
    assert [name for name in names if name != "[Unreleased"][:2] == ["[0.2.0", "[0.1.0"]
    assert [r.splitlines()[0] for r in releases if len(r.splitlines()) > MOST_LINES_OF_A_RELEASE] == []


def test_a_script_makes_every_picture_on_a_page() -> None:
    """By its name, without a number; in the gallery, by its tile's. first_screen.jpg is a browser's, of a report."""
    run = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    listed = run.stdout.splitlines()
    scripts = "\n".join((ROOT / name).read_text() for name in listed if name.endswith((".py", ".sh")))
    pages = "\n".join((ROOT / name).read_text() for name in listed if name.endswith(".md"))
    pictures = {pathlib.Path(name).stem for name in re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", pages)} - {"first_screen"}
    named = set(re.findall(r"\w+", scripts))
    assert len(pictures) > 100
    assert not [name for name in sorted(pictures) if not set(re.sub(r"-\d+$", "", name).split("-")) <= named]
