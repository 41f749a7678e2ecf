# SPDX-License-Identifier: Apache-2.0
"""Lists what sources import and include; each Python file is parsed once for all tests that ask."""

import ast
import functools
import pathlib
import re

NATIVE_SUFFIXES = {".h", ".hpp", ".inc", ".c", ".cpp", ".comp", ".glsl", ".rgen", ".rchit", ".rmiss", ".rahit"}


@functools.cache
def imports(path: pathlib.Path) -> frozenset[tuple[str, str]]:
    """Returns (module, imported name or "") of each absolute import, wherever it stands in the file."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), filename=str(path))):
        if isinstance(node, ast.Import):
            found |= {(alias.name, "") for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found |= {(node.module, alias.name) for alias in node.names}
    return frozenset(found)


def imported_packages(path: pathlib.Path) -> set[str]:
    return {module.split(".")[0] for module, _ in imports(path)}


def includes(path: pathlib.Path) -> list[str]:
    """Names that a C, C++ or GLSL source includes."""
    return re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(), re.MULTILINE)


def layers_of_simsense(root: pathlib.Path) -> list[set[str]]:
    """The README's layers, lowest first: each line of a fenced block has the folders of one before its colon."""
    readme = (root / "simsense/README.md").read_text(encoding="utf-8")
    block = re.search(r"```layers\n(.*?)```", readme, re.DOTALL)
    assert block, "simsense/README.md has no fenced block called layers"
    return [set(re.findall(r"\w+", line.split(":")[0])) for line in block.group(1).splitlines() if line.strip()]
