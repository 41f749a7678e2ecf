# SPDX-License-Identifier: Apache-2.0
"""Picks the frame to show first, by its error."""

# The residual scale ends here, in noise floors: white noise stays pale, a failing model shows.
from __future__ import annotations

from typing import Any

RESIDUAL_FLOORS = 4.0


def worst_frame(scores: dict[str, Any], split: str) -> dict[str, Any]:
    """The entry of scores["frames"] with the infrared error furthest above its floor, or with the largest error without
    floors."""
    entries = [e for e in scores["frames"] if e["split"] == split]
    return max(
        entries, key=lambda e: (e["rmse_dn"] if e["explainable_rmse_dn"] is None else e["explainable_rmse_dn"]) or 0.0
    )
