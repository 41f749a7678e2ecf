# SPDX-License-Identifier: Apache-2.0
"""Writes NOTICE from the notes in this folder: one paragraph for every dependency, with its licence and how it is used.

    python3 third_party_notes/make_notice.py [--check]

--check writes nothing and ends with 1 where NOTICE is not up to date.
"""

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
NOTICE = HERE.parent / "NOTICE"
FIELDS = ("Version", "Licence", "How linked", "Why this one")
HEAD = """\
activestereo
Copyright 2025 The activestereo authors

Licensed under the Apache License, Version 2.0 (see LICENSE).

This project uses the following software of others, each under its own licence. The list is made from third_party_notes.
"""


def read_note(path: Path) -> tuple[str, dict[str, str]]:
    """Title and fields of a note; every note has all of FIELDS."""
    lines = path.read_text(encoding="utf-8").splitlines()
    fields = dict(line.removeprefix("- ").split(": ", 1) for line in lines[1:] if line.startswith("- "))
    missing = [name for name in FIELDS if not fields.get(name)]
    if missing or not lines[0].startswith("# "):
        sys.exit(f"{path}: {', '.join(missing) or 'the title'} is missing; a note has a title and {', '.join(FIELDS)}")
    return lines[0].removeprefix("# "), fields


def notice_text() -> str:
    notes = [read_note(path) for path in sorted(HERE.glob("*.md"))]
    parts = [f"{t}\n  Licence: {f['Licence']}\n  Version: {f['Version']}\n  Use: {f['How linked']}\n" for t, f in notes]
    return "\n".join([HEAD, *parts])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; end with 1 where NOTICE is not up to date")
    check = parser.parse_args().check
    text = notice_text()
    if NOTICE.exists() and NOTICE.read_text(encoding="utf-8") == text:
        return 0
    if check:
        print("NOTICE is not up to date: run third_party_notes/make_notice.py")
        return 1
    NOTICE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
