# SPDX-License-Identifier: Apache-2.0
"""The measured distance of the image functions from the engines: `activestereo effect check --all --out`."""

import json
from pathlib import Path

_FILE = Path(__file__).resolve().parents[1] / "differences.json"


def known_differences() -> dict[str, float]:
    """{effect id: relative difference}, as measured last."""
    return json.loads(_FILE.read_text(encoding="utf-8")) if _FILE.is_file() else {}
