# SPDX-License-Identifier: Apache-2.0
"""ARCHITECTURE.md's table of dependencies of top-level folders is what the sources include and import: no more, no
less."""

import pathlib
import re

import pytest
from python_imports import imported_packages

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
NATIVE = {".h", ".hpp", ".inc", ".c", ".cpp", ".comp", ".glsl", ".rgen", ".rchit", ".rmiss", ".rahit"}
# Where an include may be found: the includer's own library first, then every folder that an include path could have.
SHARED_ROOTS = (
    "capi/include",
    "capi",
    "python",
    "kuafu",
    "kuafu/src",
    "kuafu/shaders",
    "simsense/src",
    "simsense/shaders",
    "tests",
)
PYTHON_ROOTS = {"kuafu": "python/kuafu", "simsense": "python/simsense", "activestereo": "python/activestereo"}


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
    """Paths in the repository that a native source includes; what is not found there is the system's, or made by the
    build."""
    top = path.relative_to(ROOT).parts[0]
    roots = (path.parent, ROOT / top / "src", ROOT / top / "shaders", *(ROOT / root for root in SHARED_ROOTS))
    found = set()
    for name in re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(), re.MULTILINE):
        target = next((root / name for root in roots if (root / name).is_file()), None)
        if target is not None:
            found.add(target.resolve().relative_to(ROOT).as_posix())
    return found


def imported(path: pathlib.Path) -> set[str]:
    """Folders of the repository that a Python source imports, wherever in the file."""
    names = imported_packages(path)
    return {f"{PYTHON_ROOTS[name]}/" for name in names & set(PYTHON_ROOTS)} | {
        f"{name}/" for name in names & {"tests", "examples"}
    }


def used_folders(folder: str) -> dict[str, list[str]]:
    """Other folders that the sources of a folder use, each with the sources that do."""
    found: dict[str, list[str]] = {}
    for path in (ROOT / folder).rglob("*"):
        reads = (
            included
            if path.suffix in NATIVE
            else imported
            if path.suffix == ".py" and "__pycache__" not in path.parts
            else None
        )
        for target in reads(path) if reads else ():
            found.setdefault(folder_of(target), []).append(f"{path.relative_to(ROOT)} uses {target}")
    return found


@pytest.mark.parametrize(("folders", "allowed"), ROWS, ids=lambda names: "+".join(names) or "nothing")
def test_dependencies_are_those_of_the_page(folders: list[str], allowed: list[str]) -> None:
    used = {name: lines for folder in folders for name, lines in used_folders(folder).items() if name not in folders}
    assert not [line for name, lines in used.items() if name not in allowed for line in lines]
    assert set(allowed) == set(used), "the page names a dependency that no source has"


def test_every_folder_of_sources_has_its_row() -> None:
    suffixes = NATIVE | {".py"}
    tops = {p.name for p in ROOT.iterdir() if p.is_dir() and not p.name.startswith(".") and p.name != "build"}
    with_row = {folder for folders, _ in ROWS for folder in folders} | {"tests"}
    scripts = {"third_party_notes", "capi/packaging", "capi/generation"}  # they run at build time and use nothing
    for top in sorted(tops):
        for path in (ROOT / top).rglob("*"):
            name = path.relative_to(ROOT).as_posix()
            if (
                path.suffix in suffixes
                and "__pycache__" not in name
                and not name.startswith(tuple(f"{s}/" for s in scripts))
            ):
                assert folder_of(name) in with_row, name
