# SPDX-License-Identifier: Apache-2.0
"""Docstrings are sentences or noun phrases with their subject first: none begins with "Of" or "What"."""

import ast
import pathlib

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = ("capi", "kuafu", "simsense", "python", "examples", "tests", "third_party_notes")
NO_SUBJECT = ("Of ", "What ")
Documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def without_subject(source: str) -> list[str]:
    docstrings = [ast.get_docstring(node) or "" for node in ast.walk(ast.parse(source)) if isinstance(node, Documented)]
    return [text.split("\n")[0] for text in docstrings if text.startswith(NO_SUBJECT)]


def test_docstrings_begin_with_their_subject() -> None:
    assert without_subject(
        '"""Of the fit: its error."""\ndef f():\n    """What it is."""\nclass Offset:\n    """Offset."""'
    )
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    assert len(paths) > 300
    found = {path.relative_to(ROOT): without_subject(path.read_text(encoding="utf-8")) for path in paths}
    assert not {str(path): lines for path, lines in found.items() if lines}
