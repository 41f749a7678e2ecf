# SPDX-License-Identifier: Apache-2.0
"""The lab: compare the simulator with a capture, see where it fails, learn which effect is missing, add it."""

from __future__ import annotations

from typing import Any

from activestereo.lab.compare import Comparison, compare
from activestereo.lab.diagnose import Diagnosis, diagnose
from activestereo.lab.lab_object import Lab

__all__ = ["Comparison", "Diagnosis", "Lab", "compare", "diagnose", "summary_table", "write_report"]


def __getattr__(name: str) -> Any:
    """Reports are loaded when asked for: a diagnosis draws nothing, and need not wait for what does."""
    if name not in ("summary_table", "write_report"):
        raise AttributeError(f"module {__name__} has no attribute {name}")
    from activestereo.lab import report

    return getattr(report, name)
