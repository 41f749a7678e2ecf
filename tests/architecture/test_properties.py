# SPDX-License-Identifier: Apache-2.0
"""Properties hide no work: none renders, reads or waits, since several threads may run even a cached one at once."""

import ast
import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2] / "python"
# What a property may call: arithmetic on the object's own fields. A call that is new here is looked at first, with all
# that it calls; work belongs into a method, and what is kept into one with @computed_once.
PURE = {
    "abs", "all", "any", "bool", "dict", "float", "getattr", "int", "isinstance", "len", "list", "map", "max", "min",
    "next", "str", "sum", "tuple", "zip",
    "arange", "array", "asarray", "astype", "bincount", "concatenate", "copy", "floor", "full", "matrix", "mean",
    "norm", "ravel", "reshape", "stack", "tolist", "zeros",
    "asdict", "data_ptr", "element_size", "is_distorting", "items", "replace", "stride", "values",
    "EngineFault", "Nuisances", "Remainder", "RuntimeError", "ValueError",
    "_of_stages", "_reach", "camera_to_world", "get_global_pose", "_select", "of_parameters", "sum_of",
}  # fmt: skip


def working_properties(source: str) -> list[str]:
    """'name calls work' of each property that may do some, and 'name is cached' of each whose result is kept."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef):
            continue
        decorators = {getattr(d, "id", getattr(d, "attr", "")) for d in node.decorator_list}
        if "cached_property" in decorators:
            found.append(f"{node.name} is cached")
        if "property" not in decorators:
            continue
        for call in (inner for inner in ast.walk(node) if isinstance(inner, ast.Call)):
            name = getattr(call.func, "id", getattr(call.func, "attr", ""))
            is_text = isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Constant)
            if name not in PURE and not is_text:
                found.append(f"{node.name} calls {name}")
    return found


@pytest.mark.parametrize("package", ["activestereo", "kuafu", "simsense"])
def test_no_property_renders_reads_or_waits(package):
    found = {
        str(path.relative_to(ROOT)): names
        for path in sorted((ROOT / package).rglob("*.py"))
        if "property" in (source := path.read_text()) and (names := working_properties(source))
    }
    assert not found


@pytest.mark.parametrize("work", ["self.engine.render(1)", "self._test()", "engine_version(self._device)"])
def test_a_property_that_works_is_found(work):
    assert working_properties(f"class A:\n    @property\n    def images(self):\n        return {work}\n")


def test_a_property_that_keeps_its_result_is_found():
    source = "class A:\n    @cached_property\n    def images(self):\n        return self.a + 1\n"
    assert working_properties(source) == ["images is cached"]
