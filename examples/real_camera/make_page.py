#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of README.md from results.json: each stands between <!-- NAME --> and <!-- end -->.

    python3 examples/real_camera/make_page.py            # writes them
    python3 examples/real_camera/make_page.py --check    # fails where one is not what the results say

A table of results.json has the command that gave it, its columns, and rows of texts or numbers; null is a blank.
"""

import json
import re
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
PAGE, RESULTS = FOLDER / "README.md", FOLDER / "results.json"
_TABLE = re.compile(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def main(arguments):
    text = PAGE.read_text(encoding="utf-8")
    written = filled(text, json.loads(RESULTS.read_text(encoding="utf-8")))
    if arguments == ["--check"]:
        if text != written:
            print("examples/real_camera/README.md is not what results.json says: run make_page.py there")
        return int(text != written)
    PAGE.write_text(written, encoding="utf-8")
    return 0


def filled(text, results):
    """The page with its tables from the results. ValueError where a table is on one of both sides alone."""
    names = {match.group(2) for match in _TABLE.finditer(text)}
    if names != set(results):
        raise ValueError(f"README.md has {sorted(names)}, results.json {sorted(results)}")
    table = {name: "\n".join(_table(result)) for name, result in results.items()}
    return _TABLE.sub(lambda found: f"{found.group(1)}{table[found.group(2)]}\n{found.group(3)}", text)


def _table(result):
    columns, rows = result["columns"], result["rows"]
    if any(len(row) != len(columns) for row in rows):
        raise ValueError(f"a row of '{result['command']}' has not {len(columns)} columns")
    texts = (["" if value is None else str(value) for value in row] for row in rows)
    lines = [[str(name) for name in columns], ["--"] * len(columns), *texts]
    return ["", *(f"|{'|'.join(line)}|" for line in lines), ""]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
