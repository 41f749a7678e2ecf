# SPDX-License-Identifier: Apache-2.0
"""Docstrings are sentences or noun phrases with their subject first: none begins with "Of" or "What"."""

import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = ("capi", "kuafu", "simsense", "python", "examples", "tests", "third_party_notes")
NO_SUBJECT = re.compile(r'^ *[rR]?"""((?:Of|What) .*)', re.MULTILINE)


def test_docstrings_begin_with_their_subject() -> None:
    sample = '"""Of the fit: its error."""\ndef f():\n    """What it is."""\nclass Offset:\n    """Offset."""'
    assert len(NO_SUBJECT.findall(sample)) == 2
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    assert len(paths) > 300
    found = {path.relative_to(ROOT): NO_SUBJECT.findall(path.read_text(encoding="utf-8")) for path in paths}
    assert not {str(path): lines for path, lines in found.items() if lines}
