# SPDX-License-Identifier: Apache-2.0
"""No work hides in attribute access: a property neither renders nor reads nor waits, for since Python 3.12 even a
cached one may run in several threads at once."""

import ast
import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2] / "python"
PROPERTIES = {"property", "cached_property"}
# Calls that render, read a file, start work or wait for some.
WORK = {
    "render", "submit", "expected", "lights", "rendering", "take_picture", "compute", "compute_depth",
    "open", "read_text", "read_bytes", "read_json", "load", "loadtxt", "imread", "run", "Popen",
    "wait", "join", "sleep", "calibrate", "result",
}  # fmt: skip


def working_properties(source: str) -> list[str]:
    """'name calls work' of each property that does some."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef):
            continue
        decorators = {getattr(d, "id", getattr(d, "attr", "")) for d in node.decorator_list}
        if not decorators & PROPERTIES:
            continue
        for call in (inner for inner in ast.walk(node) if isinstance(inner, ast.Call)):
            name = getattr(call.func, "id", getattr(call.func, "attr", ""))
            is_text = isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Constant)
            if name in WORK and not is_text:
                found.append(f"{node.name} calls {name}")
    return found


@pytest.mark.parametrize("package", ["activestereo", "kuafu", "simsense"])
def test_no_property_renders_reads_or_waits(package):
    found = {
        str(path.relative_to(ROOT)): names
        for path in sorted((ROOT / package).rglob("*.py"))
        if (names := working_properties(path.read_text()))
    }
    assert not found


def test_a_property_that_renders_is_found():
    source = "class A:\n    @cached_property\n    def images(self):\n        return self.engine.render(1)\n"
    assert working_properties(source) == ["images calls render"]
