# SPDX-License-Identifier: Apache-2.0
"""Estimates the time of a phase of long work from earlier runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

# A guess without a run is off by so much, either way.
_GUESS = 2.0
# Runs on work that differs by less than this factor tell the time of this one.
_ALIKE = 1.5
# The next run exceeds the span of the runs that are known by this share, the less the more there are.
_OTHER_RUNS = 0.5


@dataclass(frozen=True)
class UsualTime:
    """fixed_s, per_work_s: a guess, constant seconds and seconds per unit of work. runs: (units of work, seconds) of
    earlier runs, which replace the guess."""

    fixed_s: float = 0.0
    per_work_s: float = 0.0
    runs: Sequence[tuple[float, float]] = ()

    def span_s(self, work: float) -> tuple[float, float, float]:
        """(shortest, likely, longest) seconds of so much work."""
        alike = [seconds for other, seconds in self.runs if max(work, other) <= _ALIKE * min(work, other)]
        if alike:
            spread = 1.0 + _OTHER_RUNS / len(alike)
            return min(alike) / spread, median(alike), spread * max(alike)
        if self.runs:  # between a constant time and one proportional to the work
            other, seconds = min(self.runs, key=lambda run: max(run[0] / work, work / run[0]))
            ends = sorted((seconds, seconds * work / other))
            return ends[0], (ends[0] * ends[1]) ** 0.5, ends[1]
        guess = self.fixed_s + self.per_work_s * work
        return guess / _GUESS, guess, guess * _GUESS
