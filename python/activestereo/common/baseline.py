# SPDX-License-Identifier: Apache-2.0
"""The distance between a pair's cameras: its calibration's, or the user's where that has none or none of this world."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Twice that of the widest rigs of cars; what files tell above it is in millimetres, or in squares of a board.
MOST_BASELINE_M = 2.0
_AGREEING = 0.02


def unit_question(baseline: float) -> str | None:
    """The question, in words that follow a name, where a baseline can only be in another unit than metres."""
    if baseline <= MOST_BASELINE_M:
        return None
    return (
        f"is {baseline:g} m, more than any pair of depth cameras is apart: is it in millimetres? Then give --baseline "
        f"{1e-3 * baseline:g}"
    )


def chosen_baseline_m(name: str, told_m: float, given_m: float | None) -> float:
    """The baseline that a calibration tells (0: none), else the one that --baseline gives. ValueError, which begins
    with the calibration's name, where there is none, where both differ, or where it cannot be in metres."""
    question = unit_question(told_m)
    if given_m is None:
        if told_m == 0.0:
            raise ValueError(f"{name}: the baseline is nowhere in it: give --baseline M, metres")
        if question is not None:
            raise ValueError(f"{name}: the baseline {question}")
        return told_m
    if told_m > 0.0 and question is None and abs(given_m / told_m - 1.0) > _AGREEING:
        raise ValueError(f"{name}: the baseline is {told_m:g} m, --baseline {given_m:g}: leave out --baseline")
    return given_m


def with_baseline(name: str, left_to_right: NDArray[np.float64], given_m: float | None) -> NDArray[np.float64]:
    """The same motion with the chosen length. ValueError as by chosen_baseline_m()."""
    told_m = float(np.linalg.norm(left_to_right[:3, 3]))
    baseline_m, out = chosen_baseline_m(name, told_m, given_m), left_to_right.copy()
    out[:3, 3] = left_to_right[:3, 3] * (baseline_m / told_m) if told_m > 0.0 else (-baseline_m, 0.0, 0.0)
    return out
