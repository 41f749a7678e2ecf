#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes what follows from the tables of the public structs and is committed: headers, stubs, pages. `--check` changes
nothing and fails where such a file is stale. `--build FOLDER`, which CMake calls, writes the rest."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import emit_abi
import emit_api_table
import emit_c
import emit_cpp
import emit_ffi
import emit_kuafu
import emit_page
import emit_python
import emit_shader
from table import FOLDER, TableError, Tables, read_tables
from words import licensed

ROOT = FOLDER.parents[1]
LIBRARIES = ("kuafu", "simsense")


def stub(tables: Tables, library: str) -> str:
    """Returns python/<library>/_<library>.pyi, the type stub of the library's Python module."""
    sources = (ROOT / f"python/{library}/_{library}.pyi.in", ROOT / "python/bindings/shared.pyi.in")
    return emit_python.stub(tables, library, *(path.read_text() for path in sources))


def outputs(tables: Tables) -> dict[str, str]:
    """Returns {path from the repository's root: text} of every committed file. Raises TableError."""
    embedded = emit_c.embedded_structs(tables)
    files = {f"capi/include/{entry.path}": emit_c.header(entry, embedded) for entry in tables.headers}
    emit_abi.check_no_padding(tables)
    for library in LIBRARIES:
        files[f"capi/include/{library}/api.h"] = emit_api_table.header(library)
        files[f"python/{library}/_{library}.pyi"] = stub(tables, library)
    return files | {
        "python/activestereo/common/parameters.json": emit_python.parameters_json(tables),
        "python/activestereo/common/parameter_types.py": emit_python.parameter_types(tables),
        "python/activestereo/effects/core/plugin_records.py": emit_ffi.plugin_records(tables),
        "capi/generation/reference.md": emit_page.page(tables),
    }


def build_outputs(tables: Tables) -> dict[str, str]:
    """Returns {path from the build's folder of generated files: text} of every file that only the build needs."""
    files = emit_shader.records(tables)
    embedded = emit_c.embedded_structs(tables)
    callers = [entry for entry in tables.headers if not any(s.plugin for s in entry.structs)]
    headers = {f"capi/include/{entry.path}": emit_c.header(entry, embedded) for entry in callers}
    for library in LIBRARIES:
        files[f"python/{library}/docs.h"] = emit_python.docs_h(library, stub(tables, library))
        files[f"{library}/src/api/struct_table.h"] = emit_abi.struct_table(tables, library)
        files[f"{library}/src/api/struct_init.cpp"] = emit_abi.struct_init(tables, library)
        files[f"{library}/src/api/api_table.cpp"] = emit_api_table.source(library)
    return files | {
        "capi/device/struct_table.h": emit_abi.struct_table(tables, "ks"),
        "tests/capi/abi_layout_tables.c": emit_abi.layout_test(tables),
        "tests/capi/functions_of_handles.h": "".join(map(emit_api_table.functions_of_handles, LIBRARIES)),
        "simsense/src/parameters/fields.h": emit_cpp.simsense_fields_h(tables),
        "simsense/src/parameters/fields.cpp": emit_cpp.simsense_fields_cpp(tables),
        "simsense/src/parameters/match_fields.h": emit_cpp.simsense_match_fields_h(tables),
        "simsense/shaders/shared/public_choices.h": emit_cpp.simsense_choices_h(tables),
        "simsense/shaders/shared/match_constants.glsl": emit_cpp.simsense_match_constants_glsl(tables),
        "python/simsense/fields.h": emit_python.simsense_fields_h(tables),
        "python/kuafu/options.h": emit_python.kuafu_options_h(tables),
        "python/kuafu/fields.h": emit_kuafu.python_fields_h(tables),
        "kuafu/src/scene/fields.h": emit_kuafu.fields_h(tables),
        "kuafu/src/scene/fields.cpp": emit_kuafu.fields_cpp(tables),
        "kuafu/src/api/fields.h": emit_kuafu.copies_h(tables),
        "kuafu/src/api/fields.cpp": emit_kuafu.copies_cpp(tables),
        "kuafu/import/material_extras.h": emit_kuafu.extras_h(tables),
        "kuafu/import/material_extras.inc": emit_kuafu.extras_schema(tables),
        "clients/interface.py": emit_ffi.python_structs(tables, headers),
        "clients/interface.rs": emit_ffi.rust_structs(tables, headers),
    }


def main() -> int:
    """Writes or checks the files. Returns 0 where all is as the tables have it, 1 where a file is stale, 2 where a
    table is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing; name the stale files and fail")
    parser.add_argument("--build", metavar="FOLDER", type=Path, help="write what only the build needs into this folder")
    arguments = parser.parse_args()
    folder = arguments.build or ROOT
    try:
        tables = read_tables()
        made = build_outputs(tables) if arguments.build else outputs(tables)
    except TableError as error:
        print(error, file=sys.stderr)
        return 2
    files = {path: licensed(path, text) for path, text in made.items()}
    stale = {
        path: text
        for path, text in files.items()
        if not (folder / path).exists() or (folder / path).read_text() != text
    }
    if arguments.check:
        for path in stale:
            print(f"{path} is not what the tables say: run python3 capi/generation/generate.py", file=sys.stderr)
        return 1 if stale else 0
    for path, text in stale.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
        print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
