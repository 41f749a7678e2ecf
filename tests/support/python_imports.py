# SPDX-License-Identifier: Apache-2.0
"""Lists the imports of Python sources; each file is parsed once for all tests that ask."""

import ast
import functools
import pathlib


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
