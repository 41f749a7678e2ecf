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
    """Returns None if a baseline, metres, is at most 2 m. Otherwise returns text that follows a name in a message and
    asks whether the unit is millimetres."""
    if baseline <= MOST_BASELINE_M:
        return None
    question = f"is {baseline:g} m, more than any pair of depth cameras is apart: is it in millimetres?"
    return f"{question} Then give --baseline {1e-3 * baseline:g}"


def chosen_baseline_m(name: str, told_m: float, given_m: float | None) -> float:
    """Returns the baseline in metres: `given_m` (the user's --baseline, None = absent) if present, else `told_m` (the
    calibration's, 0 = absent). Raises ValueError, which begins with the calibration's `name`, if both are absent or
    differ by more than 2 %. Also raises it if only `told_m` is present and exceeds 2 m."""
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
    """Returns a copy of the 4x4 left_to_right. Its translation is scaled to the length that chosen_baseline_m()
    returns; a zero translation becomes (-length, 0, 0). Raises ValueError as chosen_baseline_m() does."""
    told_m = float(np.linalg.norm(left_to_right[:3, 3]))
    baseline_m, out = chosen_baseline_m(name, told_m, given_m), left_to_right.copy()
    out[:3, 3] = left_to_right[:3, 3] * (baseline_m / told_m) if told_m > 0.0 else (-baseline_m, 0.0, 0.0)
    return out
