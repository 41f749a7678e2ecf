#!/usr/bin/env python3
"""Writes what follows from the tables of the public structs. `--check` changes nothing and fails where a committed file is stale."""

from __future__ import annotations

import argparse
import sys

import emit_c
import emit_cpp
import emit_page
import emit_python
from table import FOLDER, TableError, Tables, read_tables

ROOT = FOLDER.parents[1]


def outputs(tables: Tables) -> dict[str, str]:
    """Path from the repository's root: text, of every generated file."""
    files = {f"capi/include/{entry.path}": emit_c.header(entry) for entry in tables.headers}
    return files | {
        "simsense/src/parameters/fields.h": emit_cpp.simsense_fields_h(tables),
        "simsense/src/parameters/fields.cpp": emit_cpp.simsense_fields_cpp(tables),
        "simsense/src/parameters/match_fields.h": emit_cpp.simsense_match_fields_h(tables),
        "python/simsense/fields.h": emit_python.simsense_fields_h(tables),
        "python/activestereo/matcher_table.py": emit_python.matcher_table(tables),
        "capi/tables/reference.md": emit_page.page(tables),
    }


def main() -> int:
    """0: all is as the tables have it. 1: a file is stale. 2: a table is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing; name the stale files and fail")
    check = parser.parse_args().check
    try:
        files = outputs(read_tables())
    except TableError as error:
        print(error, file=sys.stderr)
        return 2
    stale = {path: text for path, text in files.items() if not (ROOT / path).exists() or (ROOT / path).read_text() != text}
    if check:
        for path in stale:
            print(f"{path} is not what the tables say: run python3 capi/tables/generate.py", file=sys.stderr)
        return 1 if stale else 0
    for path, text in stale.items():
        (ROOT / path).parent.mkdir(parents=True, exist_ok=True)
        (ROOT / path).write_text(text)
        print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
