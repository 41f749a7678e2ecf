# SPDX-License-Identifier: Apache-2.0
"""The tests that tests/README.md names as proofs exist, and Python's tests stand in folders named after packages."""

import pathlib
import re

TESTS = pathlib.Path(__file__).resolve().parents[1]
PAGE = (TESTS / "README.md").read_text(encoding="utf-8")


def named() -> set[str]:
    """`Suite.Name`, `...Name` (of the suite before it), `Suite.*` and `folder/test_file.py` in the last cells of
    tables."""
    cells = [line.split("|")[-2] for line in PAGE.splitlines() if line.startswith("| ") and line.count("|") > 2]
    return {name for cell in cells for name in re.findall(r"`([^`]+)`", cell)}


def test_each_named_gtest_exists() -> None:
    found = set()
    for path in TESTS.rglob("*_test.cpp"):
        for suite, name in re.findall(
            r"^(?:TYPED_)?TEST(?:_[FP])?\((\w+),\s*(\w+)\)", path.read_text(encoding="utf-8"), re.MULTILINE
        ):
            found |= {f"{suite}.{name}", f"{suite}.*", f"...{name}"}
    wanted = {
        name for name in named() if re.fullmatch(r"(\w+|\.\.)\.(\w+|\*)", name) and not name.endswith((".py", ".sh"))
    }
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
