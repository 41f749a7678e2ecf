# SPDX-License-Identifier: Apache-2.0
"""Shows the progress of long work as a bar on stderr, with the time left. The bar redraws itself on a terminal;
elsewhere it prints a line now and then."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from types import TracebackType
from typing import TextIO, overload

from activestereo.common.shown import printable

# A guess without earlier runs may be wrong by this factor, either way.
_GUESS = 2.0
# Earlier runs whose units of work differ by less than this factor predict the time directly.
_ALIKE = 1.5
# The next run may lie outside the span of the known runs by this share, divided by their number.
_OTHER_RUNS = 0.5


@dataclass(frozen=True)
class UsualTime:
    """The usual time of some work. runs: (units of work, seconds) of earlier runs. Without runs, the guess is fixed_s +
    per_work_s * units of work."""

    fixed_s: float = 0.0
    per_work_s: float = 0.0
    runs: Sequence[tuple[float, float]] = ()

    def span_s(self, work: float) -> tuple[float, float, float]:
        """Estimates the (shortest, likely, longest) seconds that `work` units of work take."""
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


_REDRAW_S = 0.1
_LINE_S = 15.0
_WIDTH = 28
# Fewest and most seconds within the first factor print as one time, within the second as "about" one.
_SURE, _NEARLY_SURE = 1.3, 4.0

# Called with the fraction done, 0..1; work that can be cancelled ends when it returns True.
Progress = Callable[[float], object]


@overload
def part_of(progress: Progress, start: float, end: float) -> Progress: ...
@overload
def part_of(progress: None, start: float, end: float) -> None: ...
@overload
def part_of(progress: Progress | None, start: float, end: float) -> Progress | None: ...
def part_of(progress: Progress | None, start: float, end: float) -> Progress | None:
    """Returns a progress function for the part start..end of the work, which maps that part's 0..1 to the whole's; None
    stays None."""
    if progress is None:
        return None
    whole = progress
    return lambda fraction: whole(start + (end - start) * fraction)


class ProgressBar:
    """A progress bar, called with fractions 0..1. As a context manager it ends the line. It never cancels the work;
    Ctrl-C does. phase: name of the running part of the work."""

    def __init__(self, label: str, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._label = printable(label)
        self._stream = stream or sys.stderr
        self._clock = clock
        self._terminal = self._stream.isatty()
        self._start = self._drawn = clock()
        self.phase = ""

    def __enter__(self) -> ProgressBar:
        self._start = self._drawn = self._clock()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.phase = ""
            self._say(1.0, f"done in {duration(self._clock() - self._start)}")
        if self._terminal:
            self._stream.write("\n")
            self._stream.flush()

    def __call__(self, fraction: float) -> None:
        elapsed = self._clock() - self._start
        left_s = elapsed * (1.0 - fraction) / fraction if fraction > 0.01 else None
        self.show(fraction, None if left_s is None else (left_s, left_s))

    def show(self, fraction: float, left_s: tuple[float, float] | None, at_once: bool = False) -> None:
        """Draws the bar if the last drawing is old or `at_once`. left_s: the fewest and most seconds left, or None if
        unknown."""
        now = self._clock()
        if not at_once and now - self._drawn < (_REDRAW_S if self._terminal else _LINE_S):
            return
        self._drawn = now
        if left_s is None:
            self._say(fraction, "...")
            return
        # '40 s'; 'about 2 min' if the two are apart, 'perhaps 2 min' if they are far apart.
        least_s, most_s = left_s
        if most_s <= _SURE * least_s or most_s < 1.0:
            self._say(fraction, f"{duration(0.5 * (least_s + most_s))} left")
            return
        middle_s = (max(least_s, 1.0) * most_s) ** 0.5
        unit_s, unit = next(((s, u) for s, u in ((3600, "h"), (60, "min")) if middle_s >= s), (1, "s"))
        number = round(middle_s / unit_s) if unit_s > 1 else max(1, 5 * round(middle_s / 5))
        self._say(fraction, f"{'about' if most_s <= _NEARLY_SURE * least_s else 'perhaps'} {number} {unit} left")

    def tell(self, text: str) -> None:
        """Writes a line that stays above the bar."""
        self._stream.write(f"\r\x1b[2K{text}\n" if self._terminal else f"{self._label}: {text}\n")
        self._stream.flush()

    def _say(self, fraction: float, note: str) -> None:
        phase = f"{self.phase}, " if self.phase else ""
        if self._terminal:
            full = round(_WIDTH * fraction)
            bar = "█" * full + "░" * (_WIDTH - full)
            self._stream.write(f"\r\x1b[2K{self._label}  {bar} {100.0 * fraction:3.0f} %  {phase}{note}")
        else:
            self._stream.write(f"{self._label}: {phase}{100.0 * fraction:.0f} %, {note}\n")
        self._stream.flush()


def duration(seconds: float) -> str:
    """Formats a duration as '0.4 s', '12 s', '3 min 05 s' or '1 h 02 min'."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    seconds = round(seconds)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02d} min"
