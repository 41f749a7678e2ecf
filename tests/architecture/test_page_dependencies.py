# SPDX-License-Identifier: Apache-2.0
"""ARCHITECTURE.md's table of dependencies of top-level folders is exactly what the sources include and import."""

import pathlib
import re

import pytest
from source_texts import NATIVE_SUFFIXES, imported_packages, includes

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
# Where an include may be found: the includer's own library first, then every folder that an include path could have.
SHARED_ROOTS = (
    "capi/include", "capi", "python", "kuafu", "kuafu/src", "kuafu/shaders", "simsense/src", "simsense/shaders",
    "tests",
)  # fmt: skip
PYTHON_ROOTS = {name: f"python/{name}" for name in ("kuafu", "simsense", "activestereo")}
PYTHON_ROOTS |= {"tests": "tests", "examples": "examples"}


def rows() -> list[tuple[list[str], list[str]]]:
    """(folders, folders that they use) of each row; a row that uses everything is left out."""
    block = re.search(r"^\| folder \| includes or imports \|\n\|[-|]+\|\n((?:\|.*\|\n)+)", PAGE, re.MULTILINE)
    assert block, "ARCHITECTURE.md has no table of dependencies"
    out = []
    for line in block.group(1).splitlines():
        folders, used = (re.findall(r"`([\w/]+)`", cell) for cell in line.strip("|").split("|"))
        if "everything" not in line:
            out.append((folders, used))
    return out


ROWS = rows()
FOLDERS = sorted({folder for folders, used in ROWS for folder in folders + used}, key=len, reverse=True)


def folder_of(path: str) -> str:
    """The folder of the table that holds a path of the repository, else its top-level folder."""
    return next((folder for folder in FOLDERS if path.startswith(f"{folder}/")), path.split("/")[0])


def included(path: pathlib.Path) -> set[str]:
    """Paths in the repository that a native source includes; others are the system's, or made by the build."""
    top = path.relative_to(ROOT).parts[0]
    roots = (path.parent, ROOT / top / "src", ROOT / top / "shaders", *(ROOT / root for root in SHARED_ROOTS))
    found = set()
    for name in includes(path):
        target = next((root / name for root in roots if (root / name).is_file()), None)
        if target is not None:
            found.add(target.resolve().relative_to(ROOT).as_posix())
    return found


def imported(path: pathlib.Path) -> set[str]:
    """Folders of the repository that a Python source imports, wherever in the file."""
    return {f"{PYTHON_ROOTS[name]}/" for name in imported_packages(path) if name in PYTHON_ROOTS}


def used_folders(folder: str) -> dict[str, list[str]]:
    """Other folders that the sources of a folder use, each with the sources that do."""
    found: dict[str, list[str]] = {}
    for path in (ROOT / folder).rglob("*"):
        used = included(path) if path.suffix in NATIVE_SUFFIXES else imported(path) if path.suffix == ".py" else ()
        for target in used:
            found.setdefault(folder_of(target), []).append(f"{path.relative_to(ROOT)} uses {target}")
    return found


@pytest.mark.parametrize(("folders", "allowed"), ROWS, ids=lambda names: "+".join(names) or "nothing")
def test_dependencies_are_those_of_the_page(folders: list[str], allowed: list[str]) -> None:
    used = {name: lines for folder in folders for name, lines in used_folders(folder).items() if name not in folders}
    assert not [line for name, lines in used.items() if name not in allowed for line in lines]
    assert set(allowed) == set(used), "the page names a dependency that no source has"


def test_every_folder_of_sources_has_its_row() -> None:
    suffixes = NATIVE_SUFFIXES | {".py"}
    tops = {p.name for p in ROOT.iterdir() if p.is_dir() and not p.name.startswith(".") and p.name != "build"}
    with_row = {folder for folders, _ in ROWS for folder in folders} | {"tests"}
    scripts = {"third_party_notes", "capi/packaging", "capi/generation"}  # they run at build time and use nothing
    for top in sorted(tops):
        for path in (ROOT / top).rglob("*"):
            name = path.relative_to(ROOT).as_posix()
            if path.suffix in suffixes and not name.startswith(tuple(f"{s}/" for s in scripts)):
                assert folder_of(name) in with_row, name


def test_the_page_keeps_the_engines_apart_and_the_device_below_both() -> None:
    allowed = {folder: set(used) for folders, used in ROWS for folder in folders}
    for folder, others in (("kuafu", {"simsense"}), ("simsense", {"kuafu"}), ("capi/device", {"kuafu", "simsense"})):
        assert not allowed[folder] & others
