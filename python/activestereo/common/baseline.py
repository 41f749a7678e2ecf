# SPDX-License-Identifier: Apache-2.0
"""Chooses the baseline of a stereo pair: the calibration's, or the user's if the calibration's is missing or
implausible."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Twice the widest baseline of cars' rigs. A larger number in a file is in millimetres, or in squares of a board.
MOST_BASELINE_M = 2.0
_AGREEING = 0.02


def unit_question(baseline: float) -> str | None:
    """Returns a question about the unit, which follows a name in a message, if a baseline is too long to be in metres;
    else None."""
    if baseline <= MOST_BASELINE_M:
        return None
    question = f"is {baseline:g} m, more than any pair of depth cameras is apart: is it in millimetres?"
    return f"{question} Then give --baseline {1e-3 * baseline:g}"


def chosen_baseline_m(name: str, told_m: float, given_m: float | None) -> float:
    """Returns the baseline in metres: the user's `given_m` (--baseline) if there is one, else the calibration's
    `told_m` (0 = none). Raises ValueError, which begins with the calibration's `name`, if both are absent or differ, or
    if the calibration's cannot be in metres."""
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
    """Returns a copy of the 4x4 left_to_right whose translation has the length that chosen_baseline_m() chooses. Raises
    its ValueError."""
    told_m = float(np.linalg.norm(left_to_right[:3, 3]))
    baseline_m, out = chosen_baseline_m(name, told_m, given_m), left_to_right.copy()
    out[:3, 3] = left_to_right[:3, 3] * (baseline_m / told_m) if told_m > 0.0 else (-baseline_m, 0.0, 0.0)
    return out
