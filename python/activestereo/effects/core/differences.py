# SPDX-License-Identifier: Apache-2.0
"""Reads the measured differences between image functions and engines: `activestereo effect check --all --out` writes
them."""

import json
from pathlib import Path

_FILE = Path(__file__).resolve().parents[1] / "differences.json"


def known_differences() -> dict[str, float]:
    """Returns {effect id: relative difference between its fast image and the engines' image}, as `activestereo effect
    check` last measured it; empty if it never ran."""
    return json.loads(_FILE.read_text(encoding="utf-8")) if _FILE.is_file() else {}
