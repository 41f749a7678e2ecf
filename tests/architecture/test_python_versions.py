# SPDX-License-Identifier: Apache-2.0
"""The lowest Python is one number everywhere; no file that users run imports a newer one (mypy finds the rest)."""

import ast
import pathlib
import re
import sys
import tomllib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
LOWEST = (3, 10)
NEWER_MODULES = {"tomllib", "annotationlib", "compression", "concurrent.interpreters", "string.templatelib"}
FILES = sorted(p for folder in ("python", "examples") for p in (ROOT / folder).rglob("*.py"))


def newer_modules(source):
    """Names of imported modules that Python's oldest promised release lacks, where sys.version_info is not asked."""
    tree = ast.parse(source, feature_version=LOWEST)
    if not any(name.split(".")[-1] in source for name in NEWER_MODULES):
        return set()
    asked = [node for node in ast.walk(tree) if isinstance(node, ast.If) and "version_info" in ast.unparse(node.test)]
    excused = {inner for node in asked for inner in ast.walk(node)}
    names = set()
    for node in ast.walk(tree):
        if node not in excused and isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif node not in excused and isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names & NEWER_MODULES


def test_every_file_is_of_the_lowest_python():
    wrong = {}
    for path in FILES:
        try:
            wrong[path.relative_to(ROOT)] = newer_modules(path.read_text(encoding="utf-8"))
        except SyntaxError as error:
            wrong[path.relative_to(ROOT)] = error
    assert not {path: what for path, what in wrong.items() if what}


def test_the_checks_find_what_is_newer():
    with pytest.raises(SyntaxError):
        newer_modules("try:\n    pass\nexcept* OSError:\n    pass")
    assert newer_modules("import tomllib") == {"tomllib"}
    assert newer_modules("from string import templatelib") == {"string.templatelib"}
    assert not newer_modules("import sys\nif sys.version_info >= (3, 11):\n    import tomllib")


def test_the_lowest_python_is_one_number():
    lowest = ".".join(map(str, LOWEST))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["requires-python"] == f">={lowest}"
    assert project["tool"]["mypy"]["python_version"] == lowest
    assert project["tool"]["ruff"]["target-version"] == f"py{lowest.replace('.', '')}"
    built = re.search(r"^all_pythons=\((.*)\)$", (ROOT / "python/wheels.sh").read_text(), re.MULTILINE)[1].split()
    assert built[0] == lowest
    assert sys.version_info[:2] in [tuple(map(int, version.split("."))) for version in built]
